"""Generates `viewer/src/protocol.ts` from `protocol.py`: constants and types.

Run `python -m ico3d.chat.generating` after each change of the protocol.
"""

from pathlib import Path

import numpy as np

from ico3d.chat.generating.vocabulary import Vocabulary
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import tensors_of
from ico3d.common.docstrings import about, notes
from ico3d.common.typed import field_types

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
        lines.append(f"  {name}: {TYPE.written(annotation)};")
    return "\n".join([*lines, "}", ""])


def exported(kind: type) -> str:
    """The TypeScript name of a dataclass.

    Messages get the suffix `Message`, because browsers define `Text` and `Error`.
    """
    return kind.__name__ + ("" if kind in NESTED else "Message")


TYPE = Vocabulary(
    array=lambda kind: "Int16Array" if kind.marks[0].dims == 1 else "Matrix",
    maybe=lambda name: f"{name} | null",
    words=lambda words: " | ".join(f'"{word}"' for word in words),
    items=lambda name, _: f"{name}[]",
    fixed=lambda names: f"[{', '.join(names)}]",
    record=lambda name, _: f"Record<string, {name}>",
    part=exported,
    plain=lambda kind: {int: "number", float: "number", str: "string", bool: "boolean"}[kind.bare],
)
"""The TypeScript type of a Python annotation."""


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
