"""Generates `viewer/src/talk/line/fields.ts` from `protocol.py`: what a server's messages are of.

Whoever answers a page may send anything, so the page looks before it takes a text for a number.
"""

import json
from pathlib import Path

from ico3d.chat.generating.vocabulary import Vocabulary
from ico3d.chat.wire import protocol
from ico3d.common.typed import field_types

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
    shapes = [
        f"{n}: {shape}" for n, annotation in annotations if (shape := SHAPE.written(annotation))
    ]
    return f"{{ {', '.join(shapes)} }}" if shapes else "{}"


SHAPE = Vocabulary(
    array=lambda _: "",
    maybe=lambda shape: f"{{ maybe: {shape} }}",
    words=lambda words: f"{{ words: {json.dumps(list(words))} }}",
    items=lambda shape, _: f"{{ list: {shape} }}",
    fixed=lambda shapes: f"{{ pair: [{', '.join(shapes)}] }}",
    record=lambda shape, _: f"{{ record: {shape} }}",
    part=lambda part: f"{{ fields: {fields_of(part)} }}",
    plain=lambda kind: {int: '"integer"', float: '"number"', str: '"string"', bool: '"boolean"'}[
        kind.bare
    ],
)
"""What a value must be; empty for an array."""
