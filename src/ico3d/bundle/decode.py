"""JSON → frozen dataclasses, with one sentence for whatever does not fit."""

import dataclasses
import json
import math
import types
import typing
from typing import Any, TypeVar

from ico3d.errors import BundleError

T = TypeVar("T")


def parse_json(data: bytes, name: str) -> Any:
    """Parses strict JSON: UTF-8, no NaN or Infinity, no repeated key.

    Raises:
        BundleError: If it is anything else.
    """
    try:
        return json.loads(
            data.decode("utf-8"),
            object_pairs_hook=_unique_keys,
            parse_constant=_refuse_constant,
        )
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{name}: is not valid JSON ({_first_line(error)}).") from error


def decode(kind: type[T], value: Any, where: str) -> T:
    """Turns parsed JSON into a dataclass by its type hints; no key may lack or be unknown.

    Args:
        kind: A dataclass whose fields are dataclasses, numbers, strings, booleans, tuples of
            those, dictionaries with string keys, or any of them or None.
        value: What `parse_json` gave.
        where: The place, for messages, such as "manifest.json: head".

    Raises:
        BundleError: Where the value does not fit.
    """
    if not isinstance(value, dict):
        raise BundleError(f"{where} must be an object, not {_describe(value)}.")
    given = typing.cast(dict[str, Any], value)
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(typing.cast(Any, kind))]
    for key in given:
        if key not in names:
            raise BundleError(f"{where} has the unknown key {key[:40]!r}.")
    for name in names:
        if name not in given:
            raise BundleError(f"{where} lacks '{name}'.")
    return kind(**{name: _decode(hints[name], given[name], f"{where}.{name}") for name in names})


def encode(value: Any) -> Any:
    """The inverse of `decode`: dataclasses → plain JSON values."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: encode(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {k: encode(v) for k, v in typing.cast(dict[str, Any], value).items()}
    if isinstance(value, tuple):
        return [encode(entry) for entry in typing.cast(tuple[Any, ...], value)]
    return value


def _decode(kind: Any, value: Any, where: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        present = next(a for a in arguments if a is not type(None))
        return None if value is None else _decode(present, value, where)
    if origin is tuple:
        return _decode_tuple(arguments, value, where)
    if origin is dict:
        return _decode_dict(arguments[1], value, where)
    if dataclasses.is_dataclass(kind):
        return decode(typing.cast(type[Any], kind), value, where)
    return _decode_scalar(kind, value, where)


def _decode_tuple(arguments: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise BundleError(f"{where} must be a list, not {_describe(value)}.")
    given = typing.cast(list[Any], value)
    if arguments[-1] is Ellipsis:
        kinds = [arguments[0]] * len(given)
    elif len(given) != len(arguments):
        raise BundleError(f"{where} must have {len(arguments)} entries, not {len(given)}.")
    else:
        kinds = list(arguments)
    return tuple(
        _decode(kind, entry, f"{where}[{i}]")
        for i, (kind, entry) in enumerate(zip(kinds, given, strict=True))
    )


def _decode_dict(kind: Any, value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BundleError(f"{where} must be an object, not {_describe(value)}.")
    given = typing.cast(dict[str, Any], value)
    return {key: _decode(kind, entry, f"{where}[{key[:80]!r}]") for key, entry in given.items()}


def _decode_scalar(kind: type, value: Any, where: str) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and number:
        return _finite(value, where)
    if isinstance(value, kind) and not (kind is int and isinstance(value, bool)):
        return value
    names = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}
    raise BundleError(f"{where} must be {names[kind]}, not {_describe(value)}.")


def _finite(value: float, where: str) -> float:
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise BundleError(f"{where} must be a finite number.")
    return result


def _describe(value: Any) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    return json.dumps(value)[:40] if isinstance(value, str | bool | None) else "a number"


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a key occurs twice")
    return result


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"{name} is no JSON number")


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:120]
