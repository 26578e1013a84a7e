"""PLY files in general: parses the header and reads tables of numbers, after checking sizes."""

import re
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError

MAX_HEADER_BYTES = 1 << 16
_ROWS_AT_ONCE = 4096  # what fits into a processor's cache while columns are picked out

_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1"},
    **{"short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2"},
    **{"int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}


@dataclass
class Element:
    """One table of a PLY file.

    Attributes:
        name: Name of the table in the header.
        count: Number of rows.
        properties: Columns in file order: numpy type (without byte order) by column name.
        has_lists: Whether a column holds lists, which makes the table's size unknown.
    """

    name: str
    count: int
    properties: dict[str, str] = field(default_factory=dict[str, str])
    has_lists: bool = False


@dataclass(frozen=True)
class Header:
    """The header of a PLY file.

    Attributes:
        order: Byte order "<" or ">", or "" for text.
        elements: Tables in file order, by name.
        size: Length of the header in bytes, which is where the first table begins.
    """

    order: str
    elements: dict[str, Element]
    size: int


def parse_header(data: bytes) -> Header:
    """Parses the header of a PLY file.

    Raises:
        GaussianFileError: If the header is damaged; the sentence names the byte.
    """
    end = re.search(rb"\nend_header[ \t]*\r?\n", data[:MAX_HEADER_BYTES])
    if end is None:
        looked_at = min(len(data), MAX_HEADER_BYTES)
        raise GaussianFileError(f"the PLY header does not end within its first {looked_at} bytes")
    order, offset = None, 0
    elements: dict[str, Element] = {}
    for line in data[: end.start()].split(b"\n"):
        words = line.decode("ascii", "replace").split()
        if words[:1] == ["format"]:
            order = _ORDERS.get(" ".join(words[1:-1]))
        elif not _take_line(words, elements):
            raise GaussianFileError(f"the PLY header has an unknown line at byte {offset}")
        offset += len(line) + 1
    if order is None:
        raise GaussianFileError(f"the PLY header names no known format before byte {end.start()}")
    return Header(order, elements, end.end())


def _take_line(words: list[str], elements: dict[str, Element]) -> bool:
    """Adds what a header line declares to the elements; whether it could be understood."""
    match words:
        case [] | ["ply"] | ["comment" | "obj_info", *_]:
            return True
        case ["element", name, count] if count.isdecimal() and len(count) < 16 and len(name) < 64:
            return elements.setdefault(name, new := Element(name, int(count))) is new
        case ["property", "list", _, _, _] if elements:
            list(elements.values())[-1].has_lists = True
            return True
        case ["property", kind, name] if elements and kind in _TYPES:
            properties = list(elements.values())[-1].properties
            known = name in properties
            properties[name] = _TYPES[kind]
            return not known
        case _:
            return False


def read_tables(data: bytes, header: Header) -> dict[str, NDArray[Any]]:
    """The tables of a PLY file as structured arrays (rows,), up to the first table with lists.

    Binary tables are views of `data`.

    Raises:
        GaussianFileError: If the file is shorter or longer than its header says.
    """
    fixed: list[Element] = []
    for element in header.elements.values():
        if element.has_lists:
            break
        fixed.append(element)
    complete = len(fixed) == len(header.elements)
    if header.order == "":
        return _read_text(data, header.size, fixed)
    return _read_binary(data, header, fixed, complete)


def _read_binary(
    data: bytes, header: Header, elements: list[Element], complete: bool
) -> dict[str, NDArray[Any]]:
    """Tables of the elements, which follow one another from the header's end."""
    tables: dict[str, NDArray[Any]] = {}
    offset = header.size
    for element in elements:
        kinds = [(name, header.order + kind) for name, kind in element.properties.items()]
        row = np.dtype(kinds)
        end = offset + element.count * row.itemsize
        if end > len(data):
            raise GaussianFileError(
                f"{element.count} rows of {element.name!r} from byte {offset} would end at byte "
                f"{end}, but the file ends at byte {len(data)}: it is cut off or damaged"
            )
        if row.itemsize:
            tables[element.name] = np.frombuffer(data, row, element.count, offset)
        offset = end
    if complete and offset != len(data):
        raise GaussianFileError(
            f"by its header the file ends at byte {offset}, but it has {len(data)} bytes"
        )
    return tables


def _read_text(data: bytes, offset: int, elements: list[Element]) -> dict[str, NDArray[Any]]:
    """Tables of float32 that stand as text from `offset` on."""
    wanted = sum(element.count * len(element.properties) for element in elements)
    if 2 * wanted > len(data) - offset + 1:  # a digit and a space each
        raise GaussianFileError(
            f"{wanted} numbers cannot stand between byte {offset} and the file's end at byte "
            f"{len(data)}: it is cut off or damaged"
        )
    numbers = _parse_numbers(data[offset:], wanted, offset)
    tables: dict[str, NDArray[Any]] = {}
    first = 0
    for element in elements:
        last = first + element.count * len(element.properties)
        row = np.dtype([(name, "f4") for name in element.properties])
        if row.itemsize:
            tables[element.name] = numbers[first:last].view(row)
        first = last
    return tables


def _parse_numbers(text: bytes, count: int, offset: int) -> NDArray[np.float32]:
    """The first `count` numbers of a text that stands at `offset` of the file."""
    if count == 0:
        return np.empty(0, np.float32)
    try:
        with warnings.catch_warnings(), np.errstate(over="ignore"):
            warnings.simplefilter("error", DeprecationWarning)  # what is no number is one of these
            numbers = np.fromstring(text, np.float32, count, sep=" ")
    except (ValueError, DeprecationWarning):
        numbers = np.empty(0, np.float32)
    if len(numbers) != count:
        raise GaussianFileError(
            f"expected {count} numbers as text from byte {offset} on, and not all are there"
        )
    return numbers


def columns(
    table: NDArray[Any], names: list[str] | tuple[str, ...], kind: str = "f4"
) -> NDArray[Any]:
    """Some columns of a table as an array (rows, len(names)) of numpy type `kind`."""
    picked = np.empty((len(table), len(names)), kind)
    with np.errstate(over="ignore"):  # doubles above float32's range: not finite, refused later
        for start in range(0, len(table), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            part = table[rows]
            for column, name in enumerate(names):
                picked[rows, column] = part[name]
    return picked
