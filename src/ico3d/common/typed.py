"""Converts parsed JSON or TOML to dataclasses along their type hints; strictness is a parameter."""

import json
import math
import tomllib
import types
import typing
from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeVar, cast

T = TypeVar("T")
MOST_VALUES = 4_000_000
"""Lists, objects and their entries of a text of JSON: parsed, each takes up to 100 bytes."""
MOST_TOML = 1 << 20
"""Characters of a text of TOML, which people write."""
MOST_TOML_COST = 10_000_000
"""Cost of a text of TOML. Python's parser keeps, for each part of a key, the parts of its table
and its own so far, and tables, which weigh as much as a hundred of them."""
_PART = 100
NAMES = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}


@dataclass(frozen=True)
class Kind:
    """A type annotation, split into its parts.

    Attributes:
        bare: The annotation without its marks: `type` of `Annotated[type, marks…]`.
        marks: The marks of the annotation, such as limits.
        origin: The generic type, such as `list` of `list[int]`.
        arguments: The arguments of the generic type, such as `int` of `list[int]`.
    """

    bare: Any
    marks: tuple[Any, ...]
    origin: Any
    arguments: tuple[Any, ...]

    @property
    def optional(self) -> Any:
        """`T` where the annotation is `T | None`, else None."""
        if self.origin not in (types.UnionType, typing.Union):
            return None
        return next(one for one in self.arguments if one is not type(None))


@cache  # every field of every message asks
def kind_of(annotation: Any) -> Kind:
    """Splits a type annotation into its parts."""
    bare, marks = annotation, ()
    if typing.get_origin(annotation) is Annotated:
        bare, marks = annotation.__origin__, annotation.__metadata__
    return Kind(bare, marks, typing.get_origin(bare), typing.get_args(bare))


@cache
def field_types(kind: type) -> dict[str, Any]:
    """Type annotations of a dataclass's fields by name, in the order of definition."""
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


@dataclass(frozen=True)
class Range:
    """A mark: limits of a number, both included."""

    low: float
    high: float

    def fault(self, value: float) -> str | None:
        """What must hold and does not, as the end of a sentence; None if the number is within."""
        if self.low <= value <= self.high:
            return None
        return f"must lie in [{self.low:g}, {self.high:g}]."


@dataclass(frozen=True)
class Length:
    """A mark: limits of the number of characters or items, both included."""

    low: int
    high: int

    def fault(self, value: Sized) -> str | None:
        """What must hold and does not, as the end of a sentence; None if the number is within."""
        if self.low <= len(value) <= self.high:
            return None
        return f"must have {self.low} to {self.high} items or characters."


class Rules:
    """How strict the conversion is, and how its error messages are worded.

    A place says where a value stands in the parsed data. In this class a place is a text;
    subclasses may use another type, which `field` then extends, and name no entries.
    """

    defaults = False
    """Whether fields that have a default may be missing."""
    null = True
    """Whether null is accepted where the type is `T | None`."""
    finite = True
    """Whether every number must be finite; marks of an annotation may restrict it further."""
    entries = True
    """Whether errors say which entry of a list or dictionary is wrong."""

    def __init__(self, error: Callable[[str], Exception]):
        """Sets the constructor of the error to raise; its argument is one sentence."""
        self.error = error

    def field(self, where: Any, name: str, kind: Kind) -> Any:
        """The place of a field, given the place of its dataclass."""
        return f"{where}.{name}"

    def entry(self, where: Any, key: int | str) -> Any:
        """The place of an entry, given the place of its list or dictionary."""
        if not self.entries:
            return where
        return f"{where}[{key}]" if isinstance(key, int) else f"{where}[{key[:80]!r}]"

    def unknown(self, where: Any, name: str, kind: type) -> str:
        """The sentence for a key that is no field of the dataclass."""
        return f"{where} has the unknown key {name[:40]!r}."

    def missing(self, where: Any, name: str) -> str:
        """The sentence for a missing field."""
        return f"{where} lacks '{name}'."

    def count(self, where: Any, wanted: int, given: int) -> str:
        """The sentence for a list of the wrong length."""
        return f"{where} must have {wanted} entries, not {given}."

    def wrong(self, where: Any, kind: Kind, value: Any) -> str:
        """The sentence for a value of the wrong type."""
        return f"{where} must be {wanted(kind)}, not {describe(value)}."

    def infinite(self, where: Any) -> str:
        """The sentence for NaN or an infinite number."""
        return f"{where} must be a finite number."

    def own(self, kind: Kind, value: Any, where: Any) -> Any:
        """Converts a value of a type that only these rules know; else returns `NotImplemented`."""
        return NotImplemented


def fill(kind: type[T], value: Any, where: Any, rules: Rules) -> T:
    """Builds a dataclass from parsed JSON or TOML.

    Args:
        kind: The dataclass. Its fields are numbers, texts, truth values, literals, dataclasses,
            lists, tuples or dictionaries of these, any of these or None, or types that `rules.own`
            converts.
        value: The parsed data.
        where: Place of the data, named in errors.
        rules: The strictness, and the wording of errors.

    Raises:
        Exception: `rules.error`, at the first value that does not fit.
    """
    return kind(**fill_fields(kind, value, where, rules))


def fill_fields(kind: type, value: Any, where: Any, rules: Rules) -> dict[str, Any]:
    """The converted fields of a dataclass by name, missing ones left out; else as for `fill`."""
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
    """Converts one value according to its annotation; other arguments and errors as for `fill`."""
    kind = kind_of(annotation)
    result = rules.own(kind, value, where)
    if result is NotImplemented:
        result = _parsed(kind, value, where, rules)
    for mark in kind.marks:
        fault = mark.fault(value) if isinstance(mark, Range | Length) else None
        if fault is not None:
            raise rules.error(f"{where}: {fault}")
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
        return fill(cast(type[Any], kind.bare), value, where, rules)
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
    """The expected type of a value, in words for users."""
    if kind.origin in (list, tuple):
        return "a list"
    return NAMES.get(kind.bare, "an object")


def describe(value: Any) -> str:
    """A value of the wrong type, in words for users; short, as it may come from an attacker."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    return json.dumps(value)[:40] if isinstance(value, str | bool | None) else "a number"


def plain(value: Any) -> Any:
    """The inverse of `fill`: dataclasses become dictionaries, tuples become lists."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in cast(dict[str, Any], value).items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in cast(Sequence[Any], value)]
    return value


def parse_json(
    data: bytes, name: str, error: Callable[[str], Exception], most: int = MOST_VALUES
) -> Any:
    """Parses strict JSON: UTF-8, no NaN or Infinity, no repeated key.

    Args:
        data: The text.
        name: What the text is, at the start of error sentences.
        error: Makes the exception to raise from one sentence.
        most: Lists, objects and their entries that it may have.

    Raises:
        Exception: `error`, if the data is not strict JSON, or has more than `most`.
    """
    try:
        text = data.decode("utf-8")
        _check_values(text, most)
        return json.loads(
            text,
            object_pairs_hook=_unique_keys,
            parse_constant=refuse_constant,
        )
    except (ValueError, RecursionError) as cause:
        line = (str(cause).splitlines() or [type(cause).__name__])[0][:120]
        raise error(f"{name}: is not valid JSON ({line}).") from cause


def loose_json(data: bytes | str, most: int = MOST_VALUES) -> Any:
    """Parses JSON that may be anybody's, as leniently as Python: NaN may be there, keys repeat.

    Args:
        data: The text.
        most: Lists, objects and their entries that it may have.

    Raises:
        ValueError: If it is no JSON in UTF-8, nested too deep, or has more than `most`.
    """
    text = data if isinstance(data, str) else data.decode("utf-8-sig")
    _check_values(text, most)
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error


def _check_values(text: str, most: int) -> None:
    if text.count("[") + text.count("{") + text.count(",") > most:
        raise ValueError(f"it has more than {most:,} values")


def parse_toml(text: str) -> dict[str, Any]:
    """Parses TOML that may be anybody's.

    Raises:
        ValueError: If the text is no TOML, longer than `MOST_TOML`, costs more than
            `MOST_TOML_COST`, or is nested too deep.
    """
    if len(text) > MOST_TOML:
        raise ValueError(f"it has more than {MOST_TOML:,} characters")
    if _toml_cost(text) > MOST_TOML_COST:
        raise ValueError("keys have too many parts, or lines too many full stops")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error


def _toml_cost(text: str) -> int:
    """The most that parsing may cost, whatever is a key, a table or prose in it.

    No key goes on in a second line, so that it has as many points as its line, or fewer; and the
    table that it is in has no more than any line before.
    """
    cost = most = 0
    for line in text.split("\n"):
        points = line.count(".")
        cost += (points + 1) * (most + points + _PART)
        most = max(most, points)
    return cost


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a key occurs twice")
    return result


def refuse_constant(name: str) -> Any:
    """Raises ValueError for NaN and Infinity, which Python's parser accepts but JSON forbids."""
    raise ValueError(f"{name} is no JSON number")
