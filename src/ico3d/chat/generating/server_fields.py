"""Generates `viewer/src/talk/line/fields.ts` from `protocol.py`: what a server's messages are of.

Whoever answers a page may send anything, so the page looks before it takes a text for a number.
"""

import json
import types
import typing
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ico3d.chat.wire import protocol
from ico3d.common.typed import field_types, kind_of

TARGET = Path(__file__).parents[4] / "viewer" / "src" / "talk" / "line" / "fields.ts"

SHAPES = """\
// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.

/** What a value of a message must be. */
export type Shape =
  | "integer"
  | "number"
  | "string"
  | "boolean"
  | { readonly maybe: Shape }
  | { readonly list: Shape }
  | { readonly record: Shape }
  | { readonly pair: readonly [Shape, Shape] }
  | { readonly words: readonly string[] }
  | { readonly fields: Fields };

/** What the values of a message must be, by their names. */
export type Fields = { readonly [field: string]: Shape };
"""


def typescript() -> str:
    """The contents of `viewer/src/talk/line/fields.ts`."""
    return "\n".join([SHAPES, server_fields()])


def server_fields() -> str:
    """What the messages that a page accepts consist of, but for their arrays."""
    lines = [
        "/** What a message of the server must consist of, but for its arrays, by its type. */",
        "export const SERVER_FIELDS: { readonly [type: string]: Fields } = {",
    ]
    for kind in protocol.SERVER_MESSAGES:
        lines.append(f"  {kind.__name__.lower()}: {fields_of(kind)},")
    return "\n".join([*lines, "};", ""])


def fields_of(kind: type) -> str:
    """The shapes of a dataclass's fields, without those of arrays."""
    annotations = field_types(kind).items()
    shapes = [f"{n}: {shape}" for n, annotation in annotations if (shape := shape_of(annotation))]
    return f"{{ {', '.join(shapes)} }}" if shapes else "{}"


def shape_of(annotation: Any) -> str:
    """What a value of a Python annotation must be; empty for an array."""
    kind = kind_of(annotation)
    bare, origin, arguments = kind.bare, kind.origin, kind.arguments
    if bare is np.ndarray:
        return ""
    if origin in (types.UnionType, typing.Union):
        return f"{{ maybe: {shape_of(arguments[0])} }}"
    if origin is Literal:
        return f"{{ words: {json.dumps(list(arguments))} }}"
    if origin is list:
        return f"{{ list: {shape_of(arguments[0])} }}"
    if origin is tuple:
        return f"{{ pair: [{', '.join(map(shape_of, arguments))}] }}"
    if origin is dict:
        return f"{{ record: {shape_of(arguments[1])} }}"
    if is_dataclass(bare):
        return f"{{ fields: {fields_of(typing.cast(type, bare))} }}"
    return {int: '"integer"', float: '"number"', str: '"string"', bool: '"boolean"'}[bare]
