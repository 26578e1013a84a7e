"""Readers of what arrives over the network: messages and requests."""

import typing
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.reader import Reader
from fuzz.readers.requests import REQUESTS, serving
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import decode_client, decode_server, encode
from ico3d.common.typed import field_types, kind_of

MESSAGES_FOR_EACH_INPUT = 10


def _value(note: Any) -> Any:
    """A small value that an annotation of the protocol allows."""
    kind = kind_of(note)
    if kind.bare is np.ndarray:
        return np.ones((2,) * kind.marks[0].dims, kind.marks[0].dtype)
    if kind.origin is typing.Literal:
        return kind.arguments[0]
    if kind.origin is list:
        return [_value(kind.arguments[0])] if kind.marks[0].high else []
    if kind.origin is tuple:
        return tuple(map(_value, kind.arguments))
    if kind.origin is dict:
        return {"a": _value(kind.arguments[1])}
    if is_dataclass(kind.bare):
        return _message(typing.cast(type, kind.bare))
    if kind.optional is not None:
        return _value(kind.optional)
    if kind.bare is str:
        return "a" * max(kind.marks[0].low, 1)
    return True if kind.bare is bool else kind.bare(max(kind.marks[0].low, 0))


def _message(kind: type) -> Any:
    return kind(**{name: _value(note) for name, note in field_types(kind).items()})


def _write(kind: type, side: str):
    """Writes a message as a file: .json for text, .frame for bytes."""

    def write(folder: Path) -> None:
        frame = encode(_message(kind))
        suffix = "json" if isinstance(frame, str) else "frame"
        content = frame.encode() if isinstance(frame, str) else frame
        (folder / f"{side}.{suffix}").write_bytes(content)

    return write


def _read(folder: Path) -> None:
    """Decodes a message, and encodes it again if it was accepted."""
    for file in folder.iterdir():
        content = file.read_bytes()
        frame = content if file.suffix == ".frame" else content.decode(errors="replace")
        encode((decode_client if file.stem == "page" else decode_server)(frame))


NETWORK = (
    Reader(
        "wire",
        {f"page {kind.__name__}": _write(kind, "page") for kind in protocol.CLIENT_MESSAGES}
        | {f"server {kind.__name__}": _write(kind, "server") for kind in protocol.SERVER_MESSAGES},
        lambda: _read,
        MESSAGES_FOR_EACH_INPUT,
    ),
    Reader("HTTP", REQUESTS, serving),
)
