"""Reads protobuf's wire format by lists of what each message may hold; all else is refused.

A runtime that is given the same bytes finds nothing in them that was not read here: two parsers
can differ in what they pass over, and here nothing is passed over.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["number", "float", "text", "bytes"]
_WIRE_TYPES = {"number": 0, "text": 2, "bytes": 2, "float": 5}
_MOST_TAG = 1 << 32
"""Runtimes drop the bits of a tag beyond these, so that one field would become another."""


@dataclass(frozen=True)
class Form:
    """What a message may hold.

    Attributes:
        name: What the message is, in errors.
        once: Kinds of the fields that occur at most once, by number. A runtime joins what occurs
            more often.
        many: Kinds of the fields that may occur again and again. Numbers are not packed.
        refused: What is wrong with other fields, by number, as the end of a sentence.
    """

    name: str
    once: "Mapping[int, Kind | Form]" = field(default_factory=dict[int, Any])
    many: "Mapping[int, Kind | Form]" = field(default_factory=dict[int, Any])
    refused: Mapping[int, str] = field(default_factory=dict[int, str])


class RefusedFieldError(ValueError):
    """A field that its message may not hold; the message is the end of a sentence."""


@dataclass
class Message:
    """What a message holds.

    Attributes:
        fields: Values by number: numbers, texts, messages, and the bytes of all else.
    """

    fields: dict[int, list[Any]]

    def all(self, number: int) -> list[Any]:
        """The values of a field in their order; none if it is not there."""
        return self.fields.get(number, [])

    def one(self, number: int, default: Any) -> Any:
        """The value of a field that occurs once, or the default."""
        return self.fields.get(number, [default])[0]


class Reader:
    """Reads messages that may be anybody's, within bounds that hold for all of them together."""

    def __init__(self, most_fields: int, most_text: int):
        """Sets how many fields, and bytes of texts, are read; both take memory in a runtime."""
        self._fields, self._text = most_fields, most_text

    def read(self, data: memoryview, form: Form) -> Message:
        """Reads a message with all that it holds.

        Raises:
            RefusedFieldError: If a message has a field that is not on its list.
            ValueError: If the data is damaged, written otherwise than in the shortest form, or more
                than is read.
        """
        found: dict[int, list[Any]] = {}
        position = 0
        while position < len(data):
            self._fields -= 1
            if self._fields < 0:
                raise ValueError("too many fields")
            tag, position = _varint(data, position)
            if tag >= _MOST_TAG:
                raise ValueError("no such field")
            number = tag >> 3
            kind = form.once.get(number) or form.many.get(number)
            if kind is None:
                raise RefusedFieldError(
                    form.refused.get(number, f"has an unexpected field {number} in its {form.name}")
                )
            if number in form.once and number in found:
                raise ValueError("a field that occurs twice")
            if tag & 7 != (2 if isinstance(kind, Form) else _WIRE_TYPES[kind]):
                raise ValueError("a field of another kind")
            value, position = self._value(data, position, kind)
            found.setdefault(number, []).append(value)
        return Message(found)

    def _value(self, data: memoryview, position: int, kind: Kind | Form) -> tuple[Any, int]:
        """A value and the position behind it."""
        if kind == "number":
            return _varint(data, position)
        length = 4
        if kind != "float":
            length, position = _varint(data, position)
        end = position + length
        if end > len(data):
            raise ValueError("cut off")
        part = data[position:end]
        if isinstance(kind, Form):
            return self.read(part, kind), end
        return self._read_text(part) if kind == "text" else part, end

    def _read_text(self, part: memoryview) -> str:
        self._text -= len(part)
        if self._text < 0:
            raise ValueError("too much text")
        return bytes(part).decode()


def _varint(data: memoryview, position: int) -> tuple[int, int]:
    """A number of 64 bits in its shortest form, and the position behind it."""
    value = 0
    for shift in range(0, 70, 7):
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            if value >= 1 << 64 or (shift and not byte):
                break
            return value, position
    raise ValueError("number too long")
