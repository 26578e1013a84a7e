"""Encodes and decodes messages, and checks them against the annotations in `protocol.py`."""

import json
import math
import struct
import typing
from dataclasses import is_dataclass, make_dataclass
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np

from ico3d.chat.wire import protocol
from ico3d.chat.wire.marks import Tensor
from ico3d.chat.wire.protocol import ClientMessage, ServerMessage
from ico3d.common.typed import (
    Kind,
    Range,
    Rules,
    field_types,
    fill_fields,
    kind_of,
    plain,
    refuse_constant,
)
from ico3d.errors import ProtocolError

HEADER_LENGTH = struct.Struct("<I")


class OversizedError(ProtocolError):
    """A frame exceeds the protocol's limits."""


def encode(message: ClientMessage | ServerMessage) -> str | bytes:
    """Encodes a message as a WebSocket frame.

    Returns:
        Text (JSON) or, for messages with arrays, bytes: u32 header length, JSON header, payload.

    Raises:
        ProtocolError: If a field violates its limits or the frame is too long.
    """
    kind = type(message)
    name = kind.__name__.lower()
    tensors = tensors_of(kind)
    arrays = {n: np.ascontiguousarray(getattr(message, n), t.dtype) for n, t in tensors.items()}
    header = plain(message)
    header.update({n: list(array.shape) for n, array in arrays.items()})
    check_header(kind, header, name)
    header = {"type": name, **header}
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    try:
        coded = text.encode()
    except UnicodeError as error:
        raise ProtocolError(f"{name}: half of a character is no text.") from error
    if not arrays:
        check_size(coded, protocol.MAX_TEXT_FRAME)
        return text
    payload = [array.tobytes() for array in arrays.values()]
    frame = b"".join([HEADER_LENGTH.pack(len(coded)), coded, *payload])
    check_size(frame, protocol.MAX_BINARY_FRAME)
    return frame


def decode_client(frame: str | bytes) -> ClientMessage:
    """Decodes and checks a frame from a page.

    Raises:
        ProtocolError: If the frame is malformed; `OversizedError` if it is too long.
    """
    return decode(frame, protocol.CLIENT_MESSAGES)


def decode_server(frame: str | bytes) -> ServerMessage:
    """Decodes and checks a frame from a server.

    Raises:
        ProtocolError: If the frame is malformed; `OversizedError` if it is too long.
    """
    return decode(frame, protocol.SERVER_MESSAGES)


def decode(frame: str | bytes, known: tuple[type, ...]) -> Any:
    """Decodes and checks a frame that must contain one of the messages `known`.

    Raises:
        ProtocolError: If the frame is malformed; `OversizedError` if it is too long.
    """
    header, payload = (unpack(frame), None) if isinstance(frame, str) else split_binary(frame)
    by_name = {message.__name__.lower(): message for message in known}
    name = header.pop("type", None)
    message_type = by_name.get(name) if isinstance(name, str) else None
    if message_type is None:
        raise ProtocolError(f"unknown message type {short(name)}.")
    tensors = tensors_of(message_type)
    if bool(tensors) != (payload is not None):
        kind = "binary" if tensors else "text"
        raise ProtocolError(f"{name}: this message travels in a {kind} frame.")
    name = typing.cast(str, name)
    values = check_header(message_type, header, name)
    if payload is not None:
        values.update(read_tensors(tensors, header, payload, name))
    return message_type(**values)


def unpack(text: str) -> dict[str, Any]:
    """The JSON object of a text frame.

    Raises:
        ProtocolError: If the text is not a JSON object; `OversizedError` if it is too long.
    """
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


def split_binary(frame: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and payload of a binary frame.

    Raises:
        ProtocolError: If the frame is malformed; `OversizedError` if it is too long.
    """
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
    """Refuses a frame above `limit` bytes.

    Raises:
        OversizedError: If the frame is larger.
    """
    if len(frame) > limit:
        raise OversizedError(f"a frame of {len(frame)} bytes is over the limit of {limit}.")


def read_tensors(
    tensors: dict[str, Tensor], header: dict[str, Any], payload: bytes, where: str
) -> dict[str, np.ndarray]:
    """Cuts the payload of a message into arrays with the shapes in the header.

    Raises:
        ProtocolError: If a shape is refused or the payload has another size.
    """
    arrays, at = {}, 0
    for name, tensor in tensors.items():
        shape, dtype = header[name], np.dtype(tensor.dtype)
        size = math.prod(shape) * dtype.itemsize
        if at + size > len(payload):
            raise ProtocolError(f"{where}.{name}: the payload is too short.")
        arrays[name] = np.frombuffer(payload[at : at + size], dtype).reshape(shape)
        at += size
    if at != len(payload):
        raise ProtocolError(f"{where}: the payload is too long.")
    return arrays


@cache
def tensors_of(message: type) -> dict[str, Tensor]:
    """Marks of a message's array fields, by name; empty for messages that are text."""
    kinds = {name: kind_of(note) for name, note in field_types(message).items()}
    return {name: kind.marks[0] for name, kind in kinds.items() if kind.bare is np.ndarray}


@cache
def header_of(message: type) -> type:
    """The dataclass of a message's header: the message with shapes in the place of arrays."""
    notes, tensors = field_types(message), tensors_of(message)
    shapes = {
        name: list[Annotated[int, Range(0, tensor.max_size)]] for name, tensor in tensors.items()
    }
    return make_dataclass(message.__name__, (notes | shapes).items(), kw_only=True)


class WireRules(Rules):
    """Rules for messages: all fields are required, no others allowed, and marks limit values."""

    finite = False  # the ranges say so
    entries = False

    def unknown(self, where: str, name: str, kind: type) -> str:
        """The sentence for a name that is no field."""
        return f"{where}: unknown field {short(name)}."

    def missing(self, where: str, name: str) -> str:
        """The sentence for a missing field."""
        return f"{where}: field '{name}' is missing."

    def count(self, where: str, wanted: int, given: int) -> str:
        """The sentence for a list of the wrong length."""
        return f"{where}: must have {wanted} items."

    def wrong(self, where: str, kind: Kind, value: Any) -> str:
        """The sentence for a value of the wrong type."""
        if kind.origin is Literal:
            return f"{where}: must be one of {', '.join(kind.arguments)}."
        wanted = {list: list, tuple: list, dict: dict}.get(kind.origin, kind.bare)
        name = "dict" if is_dataclass(wanted) else wanted.__name__
        return f"{where}: must be {name}, not {type(value).__name__}."


RULES = WireRules(ProtocolError)


def check_header(message: type, header: dict[str, Any], name: str) -> dict[str, Any]:
    """Checks the header of a message against the annotations and marks of its fields.

    Returns:
        The fields by name, an array's shape in its place.

    Raises:
        ProtocolError: If a value does not fit, or an array has other dimensions or is too large.
    """
    values = fill_fields(header_of(message), header, name, RULES)
    for field, tensor in tensors_of(message).items():
        if len(values[field]) != tensor.dims:
            raise ProtocolError(f"{name}.{field}: must have {tensor.dims} dimensions.")
        fault = Range(0, tensor.max_size).fault(math.prod(values[field]))
        if fault is not None:
            raise ProtocolError(f"{name}.{field}: {fault}")
    return values


def short(value: Any) -> str:
    """A possibly hostile value, shortened and escaped for quoting."""
    return ascii(value)[:40]
