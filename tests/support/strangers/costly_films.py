"""Small films that take FFmpeg long to open, or much memory.

It looks for each name of a tag, and for each number of a programme, among all those before it.
"""

import io
import struct
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import av

MANY, PROGRAMMES = 80_000, 60_000
NAMES = [b"%x" % number for number in range(MANY)]
SEGMENT, CLUSTER = b"\x18\x53\x80\x67", b"\x1f\x43\xb6\x75"
POLYNOMIAL = 0x04C11DB7


def film(kind: str, codec: str) -> bytes:
    """A film of one picture."""
    out = io.BytesIO()
    with av.open(out, "w", format=kind) as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        container.mux([*stream.encode(av.VideoFrame(64, 48, "yuv420p")), *stream.encode()])
    return out.getvalue()


def box(name: bytes, *content: bytes) -> bytes:
    """A box of an MP4 file."""
    data = b"".join(content)
    return struct.pack(">I4s", 8 + len(data), name) + data


def table(name: bytes, *numbers: int) -> bytes:
    """A box of a version, flags and numbers of 32 bits."""
    return box(name, bytes(4), struct.pack(f">{len(numbers)}I", *numbers))


def tagged_matroska() -> bytes:
    """Matroska with tags before its first picture, in a segment without an end."""
    tags = (_element("67c8", _element("45a3", name), _element("4487", b"1")) for name in NAMES)
    data = film("matroska", "mpeg4")
    segment, first = data.index(SEGMENT), data.index(CLUSTER)
    endless = data[:segment] + SEGMENT + b"\x01" + b"\xff" * 7 + data[segment + 12 : first]
    return endless + _element("1254c367", _element("7373", *tags)) + data[first:]


def _element(id: str, *content: bytes) -> bytes:
    data = b"".join(content)
    return bytes.fromhex(id) + struct.pack(">I", 0x10000000 | len(data)) + data


def tagged_mp4() -> bytes:
    """MP4 with a list of items in `ilst`."""
    mean, one = box(b"mean", bytes(4), b"com.apple.iTunes"), table(b"data", 0, 1)
    items = (box(b"----", mean, box(b"name", bytes(4), name), one) for name in NAMES)
    handler = box(b"hdlr", bytes(8), b"mdir", bytes(13))
    tags = box(b"udta", box(b"meta", bytes(4), handler, box(b"ilst", *items)))
    data = film("mp4", "mpeg4")
    at = data.index(b"moov") - 4
    length = struct.unpack(">I", data[at : at + 4])[0]
    return data[:at] + box(b"moov", data[at + 8 : at + length], tags) + data[at + length :]


def tagged_avi() -> bytes:
    """AVI with remarks of four letters."""
    names = (struct.pack(">I", 0x41414141 + number) for number in range(MANY))
    remarks = b"INFO" + b"".join(name + b"\2\0\0\0" + b"1\0" for name in names)
    data = film("avi", "mpeg4")
    first = data.rindex(b"LIST")
    return data[:first] + b"LIST" + struct.pack("<I", len(remarks)) + remarks + data[first:]


def tagged_flv() -> bytes:
    """FLV whose script names values."""
    values = (struct.pack(">H", len(name)) + name + b"\0" + bytes(8) for name in NAMES)
    script = b"\2\0\x0aonMetaData\x08" + struct.pack(">I", MANY) + b"".join(values) + b"\0\0\x09"
    head = b"\x12" + len(script).to_bytes(3, "big") + bytes(7)
    data = film("flv", "flv")
    return data[:13] + head + script + struct.pack(">I", 11 + len(script)) + data[13:]


def tagged_asf() -> bytes:
    """ASF with objects of tags."""
    objects = b""
    for first in range(0, MANY, 10_000):
        names = (f"{number:05}".encode("utf-16le") for number in range(first, first + 10_000))
        tags = b"".join(
            struct.pack("<H", 12) + name + bytes(2) + struct.pack("<HH4s", 0, 4, b"1\0\0\0")
            for name in names
        )
        guid = bytes.fromhex("40a4d0d207e3d21197f000a0c95ea850")
        objects += guid + struct.pack("<QH", 26 + len(tags), 10_000) + tags
    data = film("asf", "mpeg4")
    size, count = struct.unpack("<QI", data[16:28])
    head = struct.pack("<QI", size + len(objects), count + MANY // 10_000)
    return data[:16] + head + data[28:30] + objects + data[30:]


def of_many_programmes() -> bytes:
    """A transport stream whose tables name programmes."""
    packets = bytearray()
    for first in range(1, PROGRAMMES, 250):
        version = 0xC1 | first // 250 % 32 << 1
        named = struct.pack(">500H", *(v for n in range(first, first + 250) for v in (n, 0xE020)))
        head = b"\0" + struct.pack(">HHBBB", 0xB000 | len(named) + 9, 1, version, 0, 0)
        packets += _packets(head + named + _check(head + named), first // 250 * 6)
    return bytes(packets) + film("mpegts", "mpeg2video")


def _packets(section: bytes, number: int) -> bytes:
    """A table in packets of 188 bytes, counted from a number on."""
    section, out = b"\0" + section, b""
    for at in range(0, len(section), 184):
        head = struct.pack(">BHB", 0x47, 0 if at else 0x4000, 0x10 | (number + at // 184) % 16)
        out += head + section[at : at + 184].ljust(184, b"\xff")
    return out


def _check(data: bytes) -> bytes:
    """The sum by which a table is checked."""
    value, steps = 0xFFFFFFFF, _steps()
    for byte in data:
        value = (value << 8 & 0xFFFFFFFF) ^ steps[value >> 24 ^ byte]
    return struct.pack(">I", value)


@cache
def _steps() -> list[int]:
    found = []
    for value in range(256):
        value <<= 24
        for _ in range(8):
            value = (value << 1 ^ (POLYNOMIAL if value >> 31 else 0)) & 0xFFFFFFFF
        found.append(value)
    return found


SLOW: dict[str, Callable[[], bytes]] = {
    "tags.mkv": tagged_matroska,
    "tags.mp4": tagged_mp4,
    "tags.avi": tagged_avi,
    "tags.flv": tagged_flv,
    "tags.asf": tagged_asf,
    "programmes.ts": of_many_programmes,
}
"""Films of six megabytes at most that take seconds to be opened."""


def write_large(path: Path, tracks: int, side: int) -> None:
    """A film each of whose tracks has the same large picture, and states a small one."""
    begin = box(b"ftyp", b"qt  ", bytes(4), b"qt  ")
    picture = _png(side)
    made = [_track(number, len(begin) + 8, len(picture)) for number in range(1, tracks + 1)]
    head = box(b"mvhd", bytes(12), struct.pack(">II", 1000, 40), bytes(80))
    path.write_bytes(begin + box(b"mdat", picture) + box(b"moov", head, *made))


def _png(side: int) -> bytes:
    """A transparent picture of 16 bits."""

    def piece(name: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + check

    head = struct.pack(">IIBBBBB", side, side, 16, 6, 0, 0, 0)
    rows = zlib.compress(bytes((1 + 8 * side) * side), 9)
    pieces = piece(b"IHDR", head) + piece(b"IDAT", rows) + piece(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + pieces


def _track(number: int, at: int, length: int) -> bytes:
    kind = box(
        b"png ",
        struct.pack(">6xH16xHHII4xH32xHh", 1, 64, 64, 72 << 16, 72 << 16, 1, 24, -1),
    )
    tables = box(
        b"stbl",
        box(b"stsd", struct.pack(">II", 0, 1), kind),
        table(b"stts", 1, 1, 512),
        table(b"stsc", 1, 1, 1, 1),
        table(b"stsz", 0, 1, length),
        table(b"stco", 1, at),
    )
    about = box(b"mdhd", bytes(12), struct.pack(">IIHH", 12800, 512, 0, 0))
    handler = box(b"hdlr", bytes(4), b"mhlr", b"vide", bytes(13))
    shown = box(b"tkhd", struct.pack(">IIIIII", 15, 0, 0, number, 0, 512), bytes(60))
    media = box(b"mdia", about, handler, box(b"minf", box(b"vmhd", bytes(12)), tables))
    return box(b"trak", shown, media)
