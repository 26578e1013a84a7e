"""Messages to frames and back, checked against the annotations in `protocol.py`."""

import json
import math
import struct
import types
import typing
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np

from ico3d.chat.wire import protocol
from ico3d.chat.wire.marks import Length, Range, Tensor
from ico3d.chat.wire.protocol import ClientMessage, ServerMessage
from ico3d.errors import ProtocolError

HEADER_LENGTH = struct.Struct("<I")


class OversizedError(ProtocolError):
    """A frame is larger than the protocol allows."""


def encode(message: ClientMessage | ServerMessage) -> str | bytes:
    """A message as a WebSocket frame.

    Returns:
        Text (JSON) or, for messages with arrays, bytes: u32 header length, JSON header, payload.

    Raises:
        ProtocolError: If a field breaks its own limits or the frame is too long.
    """
    header: dict[str, Any] = {"type": type(message).__name__.lower()}
    payload = []
    for name, annotation in field_types(type(message)).items():
        value = getattr(message, name)
        tensor = tensor_of(annotation)
        if tensor:
            value = np.ascontiguousarray(value, tensor.dtype)
            payload.append(value.tobytes())
            header[name] = list(value.shape)
        else:
            header[name] = plain(value)
    check_fields(type(message), header)
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if not is_binary(type(message)):
        check_size(text.encode(), protocol.MAX_TEXT_FRAME)
        return text
    frame = b"".join([HEADER_LENGTH.pack(len(text.encode())), text.encode(), *payload])
    check_size(frame, protocol.MAX_BINARY_FRAME)
    return frame


def decode_client(frame: str | bytes) -> ClientMessage:
    """A frame from a page as a checked message.

    Raises:
        ProtocolError: If it is malformed; `OversizedError` if it is too long.
    """
    return decode(frame, protocol.CLIENT_MESSAGES)


def decode_server(frame: str | bytes) -> ServerMessage:
    """A frame from a server as a checked message.

    Raises:
        ProtocolError: If it is malformed; `OversizedError` if it is too long.
    """
    return decode(frame, protocol.SERVER_MESSAGES)


def decode(frame: str | bytes, known: tuple[type, ...]) -> Any:
    """A frame as one of the `known` messages.

    Raises:
        ProtocolError: If it is malformed; `OversizedError` if it is too long.
    """
    header, payload = (unpack(frame), None) if isinstance(frame, str) else split_binary(frame)
    by_name = {message.__name__.lower(): message for message in known}
    name = header.pop("type", None)
    message_type = by_name.get(name) if isinstance(name, str) else None
    if message_type is None:
        raise ProtocolError(f"unknown message type {short(name)}.")
    if is_binary(message_type) != (payload is not None):
        kind = "binary" if is_binary(message_type) else "text"
        raise ProtocolError(f"{name}: this message travels in a {kind} frame.")
    check_fields(message_type, header)
    values = {key: rebuilt(header[key], kind) for key, kind in field_types(message_type).items()}
    if payload is not None:
        values.update(read_tensors(message_type, header, payload))
    return message_type(**values)


def unpack(text: str) -> dict[str, Any]:
    """The JSON object of a text frame."""
    try:
        check_size(text.encode(), protocol.MAX_TEXT_FRAME)
        value = json.loads(text, parse_constant=refuse_constant)
        if "\\u" in text:  # escapes may hide lone surrogates, which nothing can encode again
            json.dumps(value, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise ProtocolError("a frame is not valid JSON.") from error
    if not isinstance(value, dict):
        raise ProtocolError("a frame is not a JSON object.")
    return value


def refuse_constant(name: str) -> None:
    """NaN and Infinity are no JSON, whatever Python thinks."""
    raise ValueError(name)


def split_binary(frame: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and payload of a binary frame."""
    check_size(frame, protocol.MAX_BINARY_FRAME)
    if len(frame) < HEADER_LENGTH.size:
        raise ProtocolError("a binary frame is too short for its header.")
    (length,) = HEADER_LENGTH.unpack_from(frame)
    end = HEADER_LENGTH.size + length
    if end > len(frame):
        raise ProtocolError("a binary frame is shorter than its header says.")
    try:
        text = frame[HEADER_LENGTH.size : end].decode()
    except UnicodeDecodeError as error:
        raise ProtocolError("a binary frame's header is not UTF-8.") from error
    return unpack(text), frame[end:]


def check_size(frame: bytes, limit: int) -> None:
    """Refuses a frame above `limit` bytes."""
    if len(frame) > limit:
        raise OversizedError(f"a frame of {len(frame)} bytes is over the limit of {limit}.")


def read_tensors(message: type, header: dict[str, Any], payload: bytes) -> dict[str, np.ndarray]:
    """Cuts the payload into the arrays whose shapes the header gives."""
    arrays, at = {}, 0
    for name, annotation in field_types(message).items():
        tensor = tensor_of(annotation)
        if tensor:
            shape, dtype = header[name], np.dtype(tensor.dtype)
            size = math.prod(shape) * dtype.itemsize
            if at + size > len(payload):
                raise ProtocolError(f"{message.__name__.lower()}.{name}: the payload is too short.")
            arrays[name] = np.frombuffer(payload[at : at + size], dtype).reshape(shape)
            at += size
    if at != len(payload):
        raise ProtocolError(f"{message.__name__.lower()}: the payload is too long.")
    return arrays


@cache
def field_types(message: type) -> dict[str, Any]:
    """Annotations of a message's fields in order."""
    hints = typing.get_type_hints(message, include_extras=True)
    return {field.name: hints[field.name] for field in fields(message)}


def tensor_of(annotation: Any) -> Tensor | None:
    """The `Tensor` mark of an annotation, if it has one."""
    marks = getattr(annotation, "__metadata__", ())
    return next((mark for mark in marks if isinstance(mark, Tensor)), None)


@cache
def is_binary(message: type) -> bool:
    """Whether a message carries arrays."""
    return any(tensor_of(annotation) for annotation in field_types(message).values())


def plain(value: Any) -> Any:
    """Nested dataclasses and tuples as what JSON has."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def rebuilt(value: Any, annotation: Any) -> Any:
    """Checked JSON as the dataclasses and tuples that the annotation names."""
    kind = kind_of(annotation)
    if kind.origin in (types.UnionType, typing.Union):  # T | None
        return None if value is None else rebuilt(value, kind.arguments[0])
    if isinstance(kind.bare, type) and is_dataclass(kind.bare):
        kinds = field_types(kind.bare)
        return kind.bare(**{name: rebuilt(value[name], kinds[name]) for name in kinds})
    if kind.origin is list:
        return [rebuilt(item, kind.arguments[0]) for item in value]
    if kind.origin is tuple:
        return tuple(value)
    return float(value) if kind.bare is float else value


@dataclass(frozen=True)
class Kind:
    """An annotation taken apart.

    Attributes:
        bare: The type in `Annotated[type, marks…]`.
        marks: Its limits.
        origin: `list` of a `list[int]`.
        arguments: `int` of it.
    """

    bare: Any
    marks: tuple
    origin: Any
    arguments: tuple


@cache  # every field of every message asks
def kind_of(annotation: Any) -> Kind:
    """What an annotation says."""
    bare, marks = annotation, ()
    if typing.get_origin(annotation) is Annotated:
        bare, marks = annotation.__origin__, annotation.__metadata__
    return Kind(bare, marks, typing.get_origin(bare), typing.get_args(bare))


def check_fields(message: type, header: dict[str, Any], where: str = "") -> None:
    """Checks names, types and limits of a JSON object against a dataclass.

    Raises:
        ProtocolError: At the first field that breaks them.
    """
    where = where or message.__name__.lower()
    kinds = field_types(message)
    for name in header:
        if name not in kinds and name != "type":
            raise ProtocolError(f"{where}: unknown field {short(name)}.")
    for name, annotation in kinds.items():
        if name not in header:
            raise ProtocolError(f"{where}: field '{name}' is missing.")
        check_value(header[name], annotation, f"{where}.{name}")


def check_value(value: Any, annotation: Any, where: str) -> None:
    """Checks one JSON value against its annotation."""
    kind = kind_of(annotation)
    bare, marks, origin, arguments = kind.bare, kind.marks, kind.origin, kind.arguments
    if origin in (types.UnionType, typing.Union):  # T | None
        if value is not None:
            check_value(value, arguments[0], where)
    elif origin is Literal:
        if not isinstance(value, str) or value not in arguments:
            raise ProtocolError(f"{where}: must be one of {', '.join(arguments)}.")
    elif origin in (list, tuple, dict):
        check_items(value, origin, arguments, where)
    elif bare is np.ndarray:
        check_shape(value, marks[0], where)
    elif is_dataclass(bare):
        check_type(value, dict, where)
        check_fields(typing.cast(type, bare), value, where)
    else:
        check_type(value, bare, where)
    for mark in marks:
        check_limit(value, mark, where)


def check_items(value: Any, origin: type, arguments: tuple, where: str) -> None:
    """Checks a list's, pair's or dictionary's items."""
    check_type(value, dict if origin is dict else list, where)
    if origin is tuple and len(value) != len(arguments):
        raise ProtocolError(f"{where}: must have {len(arguments)} items.")
    for item in value.values() if origin is dict else value:
        check_value(item, arguments[-1], where)


def check_shape(value: Any, tensor: Tensor, where: str) -> None:
    """Checks the shape that a header gives for an array."""
    check_type(value, list, where)
    if len(value) != tensor.dims:
        raise ProtocolError(f"{where}: must have {tensor.dims} dimensions.")
    for size in value:
        check_type(size, int, where)
        check_limit(size, Range(0, tensor.max_size), where)
    check_limit(math.prod(value), Range(0, tensor.max_size), where)


def check_type(value: Any, kind: type, where: str) -> None:
    """Checks a JSON type; a bool is no number, a whole number is a float too."""
    accepted = (int, float) if kind is float else kind
    if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
        raise ProtocolError(f"{where}: must be {kind.__name__}, not {type(value).__name__}.")


def check_limit(value: Any, mark: Any, where: str) -> None:
    """Checks a `Range` or `Length`."""
    if isinstance(mark, Range) and not mark.low <= value <= mark.high:
        raise ProtocolError(f"{where}: must lie in [{mark.low:g}, {mark.high:g}].")
    if isinstance(mark, Length) and not mark.low <= len(value) <= mark.high:
        raise ProtocolError(f"{where}: must have {mark.low} to {mark.high} items or characters.")


def short(value: Any) -> str:
    """A hostile value, short enough and plain enough to be quoted."""
    return ascii(value)[:40]
