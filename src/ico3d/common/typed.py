"""Parsed JSON and TOML as dataclasses: one walk along their type hints, as strict as it is told."""

import json
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeVar, cast

T = TypeVar("T")
NAMES = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}


@dataclass(frozen=True)
class Kind:
    """An annotation taken apart.

    Attributes:
        bare: The type in `Annotated[type, marks…]`.
        marks: Its marks, such as limits.
        origin: `list` of a `list[int]`.
        arguments: `int` of it.
    """

    bare: Any
    marks: tuple[Any, ...]
    origin: Any
    arguments: tuple[Any, ...]

    @property
    def optional(self) -> Any:
        """`T` of a `T | None`; None for every other annotation."""
        if self.origin not in (types.UnionType, typing.Union):
            return None
        return next(one for one in self.arguments if one is not type(None))


@cache  # every field of every message asks
def kind_of(annotation: Any) -> Kind:
    """What an annotation says."""
    bare, marks = annotation, ()
    if typing.get_origin(annotation) is Annotated:
        bare, marks = annotation.__origin__, annotation.__metadata__
    return Kind(bare, marks, typing.get_origin(bare), typing.get_args(bare))


@cache
def field_types(kind: type) -> dict[str, Any]:
    """Annotations of a dataclass's fields in order."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in fields(kind)}


@cache
def required(kind: type) -> tuple[str, ...]:
    """Names of a dataclass's fields that have no default."""
    return tuple(
        field.name
        for field in fields(kind)
        if field.default is MISSING and field.default_factory is MISSING
    )


class Rules:
    """How strict a walk is, and in which words it refuses what does not fit.

    A place is whatever `field` and `entry` make of the place given to `fill`: here a text.
    """

    defaults = False
    """Whether fields that have a default may be left out."""
    null = True
    """Whether null stands for the None of a `T | None`."""
    finite = True
    """Whether numbers must be finite; marks may say more."""

    def __init__(self, error: Callable[[str], Exception]):
        """Rules of a walk that raises `error`, made of one sentence."""
        self.error = error

    def field(self, where: Any, name: str, kind: Kind) -> Any:
        """The place of a dataclass's field."""
        return f"{where}.{name}"

    def entry(self, where: Any, key: int | str) -> Any:
        """The place of an entry of a list or a dictionary."""
        return f"{where}[{key}]" if isinstance(key, int) else f"{where}[{key[:80]!r}]"

    def unknown(self, where: Any, name: str, kind: type) -> str:
        """Refuses a name that no field of a dataclass has."""
        return f"{where} has the unknown key {name[:40]!r}."

    def missing(self, where: Any, name: str) -> str:
        """Refuses a dataclass without one of its fields."""
        return f"{where} lacks '{name}'."

    def count(self, where: Any, wanted: int, given: int) -> str:
        """Refuses a list of another length."""
        return f"{where} must have {wanted} entries, not {given}."

    def wrong(self, where: Any, kind: Kind, value: Any) -> str:
        """Refuses a value of another type."""
        return f"{where} must be {wanted(kind)}, not {describe(value)}."

    def infinite(self, where: Any) -> str:
        """Refuses a number that is none."""
        return f"{where} must be a finite number."

    def own(self, kind: Kind, value: Any, where: Any) -> Any:
        """What the rules make of a kind that the walk does not know, else `NotImplemented`."""
        return NotImplemented

    def check(self, value: Any, mark: Any, where: Any) -> None:
        """Checks a value against one mark of its annotation; raises `error` where it breaks it."""


def fill(kind: type[T], value: Any, where: Any, rules: Rules) -> T:
    """A dataclass of parsed JSON or TOML.

    Args:
        kind: Its fields are numbers, texts, truth values, literals, dataclasses, lists, tuples or
            dictionaries of those, any of them or None, or what the rules know besides.
        value: What a parser gave.
        where: Its place, for sentences.
        rules: How strict to be.

    Raises:
        Exception: `rules.error`, at the first thing that does not fit.
    """
    return kind(**fill_fields(kind, value, where, rules))


def fill_fields(kind: type, value: Any, where: Any, rules: Rules) -> dict[str, Any]:
    """The fields of a dataclass by name, those left out excepted; else as `fill`."""
    if not isinstance(value, dict):
        raise rules.error(rules.wrong(where, kind_of(kind), value))
    values = cast(dict[str, Any], value)
    notes = field_types(kind)
    for name in values:
        if name not in notes:
            raise rules.error(rules.unknown(where, name, kind))
    for name in required(kind) if rules.defaults else notes:
        if name not in values:
            raise rules.error(rules.missing(where, name))
    return {
        name: parsed(note, values[name], rules.field(where, name, kind_of(note)), rules)
        for name, note in notes.items()
        if name in values
    }


def parsed(annotation: Any, value: Any, where: Any, rules: Rules) -> Any:
    """One value by its annotation; else as `fill`."""
    kind = kind_of(annotation)
    result = rules.own(kind, value, where)
    if result is NotImplemented:
        result = _parsed(kind, value, where, rules)
    for mark in kind.marks:
        rules.check(value, mark, where)
    return result


def _parsed(kind: Kind, value: Any, where: Any, rules: Rules) -> Any:
    if kind.optional is not None:
        if value is None and rules.null:
            return None
        return parsed(kind.optional, value, where, rules)
    if kind.origin in (list, tuple):
        return _listed(kind, value, where, rules)
    if kind.origin in (dict, Mapping):
        return _mapped(kind, value, where, rules)
    if is_dataclass(kind.bare):
        return fill(cast(type, kind.bare), value, where, rules)
    if kind.origin is Literal:
        if isinstance(value, str) and value in kind.arguments:
            return value
        raise rules.error(rules.wrong(where, kind, value))
    return _scalar(kind, value, where, rules)


def _listed(kind: Kind, value: Any, where: Any, rules: Rules) -> Any:
    if not isinstance(value, list):
        raise rules.error(rules.wrong(where, kind, value))
    values, entries = cast(list[Any], value), kind.arguments
    if kind.origin is list or entries[-1] is Ellipsis:
        entries = (entries[0],) * len(values)
    elif len(values) != len(entries):
        raise rules.error(rules.count(where, len(entries), len(values)))
    made = [
        parsed(entry, values[i], rules.entry(where, i), rules) for i, entry in enumerate(entries)
    ]
    return made if kind.origin is list else tuple(made)


def _mapped(kind: Kind, value: Any, where: Any, rules: Rules) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise rules.error(rules.wrong(where, kind, value))
    values = cast(dict[str, Any], value)
    if kind.arguments[1] is Any:
        return values
    return {
        key: parsed(kind.arguments[1], entry, rules.entry(where, key), rules)
        for key, entry in values.items()
    }


def _scalar(kind: Kind, value: Any, where: Any, rules: Rules) -> Any:
    """A bool is no number; a whole number is a float too."""
    accepted = (int, float) if kind.bare is float else kind.bare
    if not isinstance(value, accepted) or (isinstance(value, bool) and kind.bare is not bool):
        raise rules.error(rules.wrong(where, kind, value))
    if kind.bare is not float:
        return value
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if rules.finite and not math.isfinite(number):
        raise rules.error(rules.infinite(where))
    return number


def wanted(kind: Kind) -> str:
    """The type that a value must have, for people."""
    if kind.origin in (list, tuple):
        return "a list"
    return NAMES.get(kind.bare, "an object")


def describe(value: Any) -> str:
    """A value of another type, for people; short, for it may be hostile."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    return json.dumps(value)[:40] if isinstance(value, str | bool | None) else "a number"


def plain(value: Any) -> Any:
    """The inverse of `fill`: dataclasses and tuples as what JSON has."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in cast(dict[str, Any], value).items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in cast(Sequence[Any], value)]
    return value


def parse_json(data: bytes, name: str, error: Callable[[str], Exception]) -> Any:
    """Parses strict JSON: UTF-8, no NaN or Infinity, no repeated key.

    Raises:
        Exception: `error`, made of one sentence that begins with `name`, if it is anything else.
    """
    try:
        return json.loads(
            data.decode("utf-8"),
            object_pairs_hook=_unique_keys,
            parse_constant=refuse_constant,
        )
    except (ValueError, RecursionError) as cause:
        line = (str(cause).splitlines() or [type(cause).__name__])[0][:120]
        raise error(f"{name}: is not valid JSON ({line}).") from cause


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a key occurs twice")
    return result


def refuse_constant(name: str) -> Any:
    """NaN and Infinity are no JSON, whatever Python thinks."""
    raise ValueError(f"{name} is no JSON number")
