"""Encodes and decodes messages, and checks them against the annotations in `protocol.py`."""

import json
import math
import struct
import typing
from dataclasses import is_dataclass
from functools import cache
from typing import Any, Literal

import numpy as np

from ico3d.chat.wire import protocol
from ico3d.chat.wire.marks import Length, Range, Tensor
from ico3d.chat.wire.protocol import ClientMessage, ServerMessage
from ico3d.common.typed import (
    Kind,
    Rules,
    field_types,
    fill_fields,
    kind_of,
    parsed,
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
    fill_fields(kind, header, name, RULES)
    header = {"type": name, **header}
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if not arrays:
        check_size(text.encode(), protocol.MAX_TEXT_FRAME)
        return text
    payload = [array.tobytes() for array in arrays.values()]
    frame = b"".join([HEADER_LENGTH.pack(len(text.encode())), text.encode(), *payload])
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
    values = fill_fields(message_type, header, name, RULES)
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


class WireRules(Rules):
    """Rules for messages: all fields are required, no others allowed, and marks limit values."""

    finite = False  # the ranges say so

    def entry(self, where: str, key: int | str) -> str:
        """The place of the whole list: entries are not distinguished."""
        return where

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

    def own(self, kind: Kind, value: Any, where: str) -> Any:
        """Converts the shape of an array, which the header contains in its field."""
        if kind.bare is not np.ndarray:
            return NotImplemented
        check_shape(value, kind.marks[0], where)
        return value

    def check(self, value: Any, mark: Any, where: str) -> None:
        """Checks a value against a mark of its field."""
        check_limit(value, mark, where)


RULES = WireRules(ProtocolError)


def check_shape(value: Any, tensor: Tensor, where: str) -> None:
    """Checks the shape that the header states for an array.

    Raises:
        ProtocolError: If the shape has other dimensions or too many elements.
    """
    for size in parsed(list[int], value, where, RULES):
        check_limit(size, Range(0, tensor.max_size), where)
    if len(value) != tensor.dims:
        raise ProtocolError(f"{where}: must have {tensor.dims} dimensions.")
    check_limit(math.prod(value), Range(0, tensor.max_size), where)


def check_limit(value: Any, mark: Any, where: str) -> None:
    """Checks a value against a `Range` or `Length`.

    Raises:
        ProtocolError: If the value violates the limit.
    """
    if isinstance(mark, Range) and not mark.low <= value <= mark.high:
        raise ProtocolError(f"{where}: must lie in [{mark.low:g}, {mark.high:g}].")
    if isinstance(mark, Length) and not mark.low <= len(value) <= mark.high:
        raise ProtocolError(f"{where}: must have {mark.low} to {mark.high} items or characters.")


def short(value: Any) -> str:
    """A possibly hostile value, shortened and escaped for quoting."""
    return ascii(value)[:40]
