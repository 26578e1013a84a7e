"""Container of Niantic's SPZ files: header, and decompression with a limit on memory.

Versions 2 and 3 are one gzip stream; version 4 is a plain header and one zstd stream per attribute.
"""

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError, MissingExtraError

MAGIC = b"NGSP"
GZIP_MAGIC = b"\x1f\x8b"
MAX_FRACTIONAL_BITS = 24
MAX_DEGREE = 3
"""Highest degree of spherical harmonics."""
_HEADER = struct.Struct("<4sIIBBBB")
_HEADER_4 = struct.Struct("<I12x")  # what version 4 has more
_STREAM = struct.Struct("<QQ")
_ANTIALIASED = 1
_PIECE = 1 << 16

MAX_RATIO = 8
"""Unpacked bytes per byte of file: 1.2 to 1.7 as a rule, 3.7 if all harmonics are 0."""

FREE_BYTES = 1 << 18
"""Unpacked bytes that are allowed at any ratio: a few equal Gaussians compress very well."""


@dataclass(frozen=True)
class Header:
    """The header of an SPZ file.

    Attributes:
        version: Version of the format: 2, 3 or 4.
        count: Number of Gaussians.
        degree: Degree of the spherical harmonics, 0 to 3.
        fractional_bits: Fractional bits of the fixed-point positions.
        flags: 1 if trained with antialiasing; all other bits announce further data.
        streams: Number of compressed streams, in version 4 only.
    """

    version: int
    count: int
    degree: int
    fractional_bits: int
    flags: int = 0
    streams: int = 0

    @property
    def sections(self) -> dict[str, int]:
        """Bytes per Gaussian of each attribute, by name in file order."""
        rotation = 3 if self.version == 2 else 4
        rest = 3 * ((self.degree + 1) ** 2 - 1)
        widths = {"positions": 9, "alphas": 1, "colors": 3, "scales": 3, "rotations": rotation}
        return widths | ({"sh": rest} if rest else {})

    @property
    def size(self) -> int:
        """Bytes of all attributes of all Gaussians."""
        return self.count * sum(self.sections.values())

    def pack(self) -> bytes:
        """The 16 bytes with which the file begins."""
        return _HEADER.pack(
            MAGIC, self.version, self.count, self.degree, self.fractional_bits, self.flags, 0
        )


def parse_header(head: bytes) -> Header:
    """Parses the first 16 bytes of an SPZ file.

    Raises:
        GaussianFileError: If they are no header of a readable SPZ file; the sentence names the
            byte.
    """
    if len(head) < _HEADER.size or head[:4] != MAGIC:
        raise GaussianFileError("byte 0 of the SPZ data does not begin a header 'NGSP' of 16 bytes")
    _, version, count, degree, bits, flags, streams = _HEADER.unpack(head)
    if version not in (2, 3, 4):
        raise GaussianFileError(f"SPZ version {version} at byte 4: expected 2, 3 or 4")
    if degree > MAX_DEGREE:
        raise GaussianFileError(f"SH degree {degree} at byte 12: expected at most {MAX_DEGREE}")
    if bits > MAX_FRACTIONAL_BITS:
        raise GaussianFileError(f"{bits} fractional bits at byte 13: positions have 24 bits in all")
    return Header(version, count, degree, bits, flags, streams)


def read_header(data: bytes) -> Header:
    """The header of an SPZ file; nothing else is unpacked.

    Raises:
        GaussianFileError: If the file has none that can be read.
    """
    return _open_gzip(data)[1] if data[:2] == GZIP_MAGIC else parse_header(data[: _HEADER.size])


def check(data: bytes) -> None:
    """Unpacks a file of version 2 or 3 to its end, a piece at a time, and keeps nothing of it.

    Of version 4 only the header is checked.

    Raises:
        GaussianFileError: As for `unpack`.
    """
    if data[:2] != GZIP_MAGIC:
        return _check_promise(read_header(data), len(data))
    stream, header = _open_gzip(data)
    _check_promise(header, len(data))
    found = 0
    while found < header.size and (piece := stream.read(min(_PIECE, header.size - found))):
        found += len(piece)
    return _finish(stream, header, found, len(data))


def unpack(data: bytes) -> tuple[Header, dict[str, NDArray[np.uint8]]]:
    """The header and the decompressed attributes, each (N, bytes), of an SPZ file.

    Raises:
        GaussianFileError: If the file is damaged, or unpacks to more than both `FREE_BYTES` and
            `MAX_RATIO` times its size; the sentence names the byte.
        MissingExtraError: If the file is version 4 and the package zstandard is not installed.
    """
    header, packed = _unpack_gzip(data) if data[:2] == GZIP_MAGIC else _unpack_zstd(data)
    sections: dict[str, NDArray[np.uint8]] = {}
    offset = 0
    for name, width in header.sections.items():
        end = offset + header.count * width
        sections[name] = packed[offset:end].reshape(header.count, width)
        offset = end
    return header, sections


def _allowed_bytes(size: int) -> int:
    """What a file of this size may unpack to."""
    return MAX_RATIO * size + FREE_BYTES


def _check_promise(header: Header, size: int) -> None:
    """Refuses more Gaussians than a file of this size can hold."""
    if header.size > _allowed_bytes(size):
        raise GaussianFileError(
            f"the count at byte 8 promises {header.count} Gaussians, {header.size} bytes unpacked: "
            f"more than a file of {size} bytes can hold, so it is damaged or hostile"
        )


class _Inflater:
    """Unpacks a gzip stream a little at a time."""

    def __init__(self, data: bytes):
        self._data = memoryview(data)
        self._next = 0
        self._stream = zlib.decompressobj(zlib.MAX_WBITS | 16)

    def read(self, size: int) -> bytes:
        """1 to `size` bytes; none at the end of the stream, whose checksum is then checked.

        Raises:
            GaussianFileError: If the stream is damaged or cut off.
        """
        while not self._stream.eof:
            piece = self._stream.unconsumed_tail
            if not piece:
                piece = self._data[self._next : self._next + _PIECE]
                self._next += len(piece)
            try:
                unpacked = self._stream.decompress(piece, size)
            except zlib.error:
                raise GaussianFileError(
                    f"the gzip stream is damaged before byte {self._next}"
                ) from None
            if unpacked:
                return unpacked
            if not len(piece) and not self._stream.eof:
                raise GaussianFileError(
                    f"the gzip stream is not over where the file ends, at byte {len(self._data)}: "
                    "it is cut off"
                )
        return b""


def _read_exactly(stream: _Inflater, target: memoryview) -> int:
    """Fills the target as far as the stream reaches; the number of bytes."""
    filled = 0
    while filled < len(target):
        piece = stream.read(min(_PIECE, len(target) - filled))
        if not piece:
            break
        target[filled : filled + len(piece)] = piece
        filled += len(piece)
    return filled


def _open_gzip(data: bytes) -> tuple[_Inflater, Header]:
    """The stream of versions 2 and 3, behind its header."""
    stream = _Inflater(data)
    head = bytearray(_HEADER.size)
    header = parse_header(bytes(head[: _read_exactly(stream, memoryview(head))]))
    if header.version == 4:
        raise GaussianFileError("SPZ version 4 at byte 4 of a gzip stream: expected 2 or 3")
    return stream, header


def _unpack_gzip(data: bytes) -> tuple[Header, NDArray[np.uint8]]:
    """Header and attributes of versions 2 and 3."""
    stream, header = _open_gzip(data)
    _check_promise(header, len(data))
    packed = np.empty(header.size, np.uint8)
    _finish(stream, header, _read_exactly(stream, packed.data), len(data))
    return header, packed


def _finish(stream: _Inflater, header: Header, found: int, size: int) -> None:
    """Goes to the end of the stream, past what the header's flags announce.

    Args:
        stream: Behind the attributes.
        header: The file's header.
        found: Bytes of the attributes that the stream had.
        size: Bytes of the file.
    """
    end = _HEADER.size + header.size
    if found < header.size:
        raise GaussianFileError(
            f"{header.count} Gaussians need {end} bytes unpacked, but there are "
            f"{_HEADER.size + found}: the count at byte 8 is damaged"
        )
    rest = 0
    while piece := stream.read(_PIECE):
        rest += len(piece)
        if header.flags & ~_ANTIALIASED == 0:
            raise GaussianFileError(f"data goes on after the last Gaussian, unpacked byte {end}")
        if header.size + rest > _allowed_bytes(size):
            raise GaussianFileError(
                f"after unpacked byte {end} follows more than {size} bytes of file can hold"
            )


def _unpack_zstd(data: bytes) -> tuple[Header, NDArray[np.uint8]]:
    """Header and attributes of version 4."""
    header = parse_header(data[: _HEADER.size])
    if header.version != 4:
        raise GaussianFileError(f"SPZ version {header.version} at byte 4 of a file without gzip")
    _check_promise(header, len(data))
    packed = np.empty(header.size, np.uint8)
    offset, filled = _first_stream(data, header), 0
    table = offset - header.streams * _STREAM.size
    for index, (name, width) in enumerate(header.sections.items()):
        compressed, size = _STREAM.unpack_from(data, table + index * _STREAM.size)
        if size != header.count * width or compressed > len(data) - offset:
            raise GaussianFileError(
                f"the stream of {name} has impossible sizes at byte {table + index * _STREAM.size}"
            )
        packed[filled : filled + size] = _unzstd(data, offset, compressed, size)
        offset, filled = offset + compressed, filled + size
    return header, packed


def _first_stream(data: bytes, header: Header) -> int:
    """Where the first stream of version 4 begins: after the table of streams."""
    if len(data) < _HEADER.size + _HEADER_4.size:
        raise GaussianFileError(f"the header of 32 bytes is cut off at byte {len(data)}")
    (table,) = _HEADER_4.unpack_from(data, _HEADER.size)
    end = table + header.streams * _STREAM.size
    if header.streams != len(header.sections) or end > len(data):
        raise GaussianFileError(
            f"{header.streams} streams (byte 15), listed at byte {table} (byte 16), do not fit "
            f"{len(header.sections)} attributes in {len(data)} bytes"
        )
    return end


def _unzstd(data: bytes, offset: int, compressed: int, size: int) -> NDArray[np.uint8]:
    """Exactly `size` bytes of the zstd frame at an offset of the file."""
    if size == 0:
        return np.empty(0, np.uint8)
    try:
        import zstandard
    except ImportError:
        raise MissingExtraError("zstandard", "files", "Reading SPZ version 4") from None
    frame = memoryview(data)[offset : offset + compressed]
    unpacked = b""
    try:
        # The frame's own size wins over max_output_size, so it is checked before.
        known = zstandard.frame_content_size(frame)
        if known in (-1, size):
            unpacked = zstandard.ZstdDecompressor().decompress(frame, max_output_size=size)
    except zstandard.ZstdError:
        pass
    if len(unpacked) != size:
        raise GaussianFileError(f"the zstd stream at byte {offset} is damaged")
    return np.frombuffer(unpacked, np.uint8)
