"""Generates `viewer/src/protocol.ts` from `protocol.py`: constants, types, encode and decode.

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
    "MAX_TEXT_FRAME": "bytes",
    "MAX_BINARY_FRAME": "bytes",
    "MAX_RATE": "messages per second",
    "MAX_BURST": "messages",
    "RESUME_SECONDS": "",
    "MAX_AHEAD_SECONDS": "",
}

NESTED = protocol.PARTS

HEAD = """\
// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.
import { floatFromHalf } from "./half.ts";
"""

CODEC = """\
/** A matrix in row order. */
export interface Matrix {
  rows: number;
  columns: number;
  values: Float32Array;
}

/** What is done with each of some messages: the compiler misses none. */
export type Handlers<M extends ServerMessage> = {
  [Type in M["type"]]: (message: Extract<M, { type: Type }>) => void;
};

/** Does what there is to be done with a message. */
export function handle<M extends ServerMessage>(message: M, handlers: Handlers<M>): void {
  (handlers[message.type as M["type"]] as (message: M) => void)(message);
}

type Header = { type: string } & Record<string, unknown>;
type Tensor = readonly [field: string, kind: "int16" | "float16"];

/** A message as a WebSocket frame. */
export function encode(message: ClientMessage): string | ArrayBuffer {
  const header: Header = { ...message };
  const tensors = TENSORS[message.type];
  if (!tensors) return JSON.stringify(header);
  const parts: Int16Array[] = [];
  for (const [field] of tensors) {
    const values = header[field] as Int16Array;
    parts.push(values);
    header[field] = [values.length];
  }
  return joinFrame(new TextEncoder().encode(JSON.stringify(header)), parts);
}

function joinFrame(header: Uint8Array, parts: Int16Array[]): ArrayBuffer {
  const length = parts.reduce((sum, part) => sum + part.byteLength, 4 + header.byteLength);
  const frame = new Uint8Array(length);
  new DataView(frame.buffer).setUint32(0, header.byteLength, true);
  frame.set(header, 4);
  let at = 4 + header.byteLength;
  for (const part of parts) {
    frame.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at);
    at += part.byteLength;
  }
  return frame.buffer;
}

/** A frame as a message; throws an Error on one that is not from this protocol. */
export function decode(frame: string | ArrayBuffer): ServerMessage {
  if (typeof frame === "string") return known(JSON.parse(frame) as Header);
  const length = new DataView(frame).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) as Header;
  let at = 4 + length;
  for (const [field, kind] of TENSORS[header.type] ?? []) {
    const shape = header[field] as number[];
    const bytes = 2 * shape.reduce((product, size) => product * size, 1);
    const words = new Uint16Array(frame.slice(at, at + bytes));
    header[field] = kind === "int16" ? new Int16Array(words.buffer) : matrix(shape, words);
    at += bytes;
  }
  return known(header);
}

function known(header: Header): ServerMessage {
  if (!SERVER_TYPES.includes(header.type)) throw new Error(`unknown message ${header.type}`);
  return header as unknown as ServerMessage;
}

function matrix(shape: number[], words: Uint16Array): Matrix {
  const [rows = 0, columns = 0] = shape;
  return { rows, columns, values: Float32Array.from(words, floatFromHalf) };
}
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
        *(interface(kind, named=False) for kind in NESTED),
        *(interface(kind, named=True) for kind in messages),
        union("ClientMessage", protocol.CLIENT_MESSAGES),
        union("ServerMessage", protocol.SERVER_MESSAGES),
        server_types(),
        tensors(messages),
        CODEC,
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
    return f"export type {name} =\n" + "\n".join(f"  | {exported(k)}" for k in kinds) + ";\n"


def server_types() -> str:
    """The list of message names that `decode` accepts."""
    names = ", ".join(f'"{kind.__name__.lower()}"' for kind in protocol.SERVER_MESSAGES)
    return f"const SERVER_TYPES = [{names}];\n"


def tensors(messages: list[type]) -> str:
    """The arrays in the payload of each binary message, in order."""
    lines = ["const TENSORS: Record<string, readonly Tensor[]> = {"]
    for kind in filter(tensors_of, messages):
        marks = tensors_of(kind)
        pairs = [f'["{n}", "{np.dtype(mark.dtype).name}"]' for n, mark in marks.items()]
        lines.append(f"  {kind.__name__.lower()}: [{', '.join(pairs)}],")
    return "\n".join([*lines, "};", ""])
