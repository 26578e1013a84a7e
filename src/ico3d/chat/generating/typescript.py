"""Generates `viewer/src/protocol.ts` from `protocol.py`: constants and types.

Run `python -m ico3d.chat.generating` after each change of the protocol.
"""

import types
import typing
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import tensors_of
from ico3d.common.docstrings import about, notes
from ico3d.common.typed import field_types, kind_of

TARGET = Path(__file__).parents[4] / "viewer" / "src" / "protocol.ts"

CONSTANTS = {
    "VERSION": "",
    "MICROPHONE_RATE": "Hz",
    "MICROPHONE_CHUNK": "samples of a message",
    "SPEECH_RATE": "Hz",
    "EXPRESSION_FPS": "rows per second",
    "RESUME_SECONDS": "",
    "BEAT_SECONDS": "",
    "MAX_TEXT_FRAME": "bytes",
    "MAX_BINARY_FRAME": "bytes",
}
"""What the page uses, with its unit."""

NESTED = protocol.PARTS

HEAD = """\
// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.
"""

SHARED = """\
/** A matrix in row order. */
export interface Matrix {
  rows: number;
  columns: number;
  values: Float32Array;
}

/** An array in the payload of a binary message. */
export type Tensor = readonly [field: string, kind: "int16" | "float16"];
"""


def typescript() -> str:
    """The contents of `viewer/src/protocol.ts`."""
    constants = [
        f"export const {name} = {getattr(protocol, name):g};" + (f" // {unit}" if unit else "")
        for name, unit in CONSTANTS.items()
    ]
    messages = [*protocol.CLIENT_MESSAGES, *protocol.SERVER_MESSAGES]
    blocks = [
        HEAD,
        "\n".join(constants) + "\n",
        SHARED,
        *(interface(kind, named=False) for kind in NESTED),
        *(interface(kind, named=True) for kind in messages),
        union("ClientMessage", protocol.CLIENT_MESSAGES),
        union("ServerMessage", protocol.SERVER_MESSAGES),
        tensors(messages),
    ]
    return "\n".join(blocks)


def interface(kind: type, named: bool) -> str:
    """A dataclass as a documented TypeScript interface."""
    told = notes(kind)
    lines = [f"/** {about(kind)} */", f"export interface {exported(kind)} {{"]
    if named:
        lines.append(f'  type: "{kind.__name__.lower()}";')
    for name, annotation in field_types(kind).items():
        lines.append(f"  /** {told[name]} */")
        lines.append(f"  {name}: {translated(annotation)};")
    return "\n".join([*lines, "}", ""])


def exported(kind: type) -> str:
    """The TypeScript name of a dataclass.

    Messages get the suffix `Message`, because browsers define `Text` and `Error`.
    """
    return kind.__name__ + ("" if kind in NESTED else "Message")


def translated(annotation: Any) -> str:
    """The TypeScript type of a Python annotation."""
    kind = kind_of(annotation)
    if kind.bare is np.ndarray:
        return "Int16Array" if kind.marks[0].dims == 1 else "Matrix"
    bare, origin, arguments = kind.bare, kind.origin, kind.arguments
    if origin in (types.UnionType, typing.Union):
        return f"{translated(arguments[0])} | null"
    if origin is Literal:
        return " | ".join(f'"{value}"' for value in arguments)
    if origin is list:
        return f"{translated(arguments[0])}[]"
    if origin is tuple:
        return f"[{', '.join(translated(argument) for argument in arguments)}]"
    if origin is dict:
        return f"Record<string, {translated(arguments[1])}>"
    if is_dataclass(bare):
        return exported(typing.cast(type, bare))
    return {int: "number", float: "number", str: "string", bool: "boolean"}[bare]


def union(name: str, kinds: tuple[type, ...]) -> str:
    """A union type of messages."""
    return f"export type {name} = {' | '.join(map(exported, kinds))};\n"


def tensors(messages: list[type]) -> str:
    """The arrays in the payload of each binary message, in order."""
    lines = [
        "/** The arrays of binary messages, in order. */",
        "export const TENSORS: Record<string, readonly Tensor[]> = {",
    ]
    for kind in filter(tensors_of, messages):
        marks = tensors_of(kind)
        pairs = [f'["{n}", "{np.dtype(mark.dtype).name}"]' for n, mark in marks.items()]
        lines.append(f"  {kind.__name__.lower()}: [{', '.join(pairs)}],")
    return "\n".join([*lines, "};", ""])
