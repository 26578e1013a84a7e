"""Films whose pictures take 18 bytes each and cost as much as any of 8192 × 4320 pixels."""

import io
from fractions import Fraction
from pathlib import Path

import av

WIDTH, HEIGHT = 512, 270
"""In blocks of 16 pixels."""


def write_empty_pictures(path: Path, count: int) -> None:
    """H.264 of one grey picture and `count` that change nothing of it."""
    _write(path, [_sequence(), _picture(), _grey("00100111"), *_all_unchanged(count)])


def write_held_pictures(path: Path, small: int, count: int) -> None:
    """H.264 of `small` pictures of 64 × 48 pixels, then `count` of which a decoder keeps sixteen.

    Those have 10 bits and no subsampled colours: 212 MB each.
    """
    units = [_sequence(4, 3), _picture(), _grey("00100111", 4 * 3), *_all_unchanged(small, 4 * 3)]
    units = units if small else []
    _write(path, [*units, _rich_sequence(), _picture(), _grey("001001111"), *_all_unchanged(count)])


def _write(path: Path, units: list[bytes]) -> None:
    raw = io.BytesIO(b"".join(b"\0\0\0\1" + unit for unit in units))
    with av.open(raw, format="h264") as given, av.open(str(path), "w") as made:
        stream = made.add_stream_from_template(given.streams.video[0])
        for number, packet in enumerate(one for one in given.demux() if one.size):
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            packet.pts = packet.dts = number
            made.mux(packet)


def _sequence(width: int = WIDTH, height: int = HEIGHT) -> bytes:
    bits = f"{66:08b}{0:08b}{62:08b}" + _ue(0, 0, 2, 1) + "0" + _ue(width - 1, height - 1)
    return _unit(0x67, bits + "1100")


def _rich_sequence() -> bytes:
    """4:4:4, 10 bits, sixteen references."""
    bits = f"{244:08b}{0:08b}{62:08b}" + _ue(0, 3) + "0" + _ue(2, 2) + "00" + _ue(0, 2, 16)
    return _unit(0x67, bits + "0" + _ue(WIDTH - 1, HEIGHT - 1) + "1100")


def _picture() -> bytes:
    return _unit(0x68, _ue(0, 0) + "00" + _ue(0, 0, 0) + "000" + _ue(0, 0, 0) + "100")


def _grey(block: str, blocks: int = WIDTH * HEIGHT) -> bytes:
    """Blocks that are predicted from nothing, without a remainder."""
    head = _ue(0, 7, 0) + "0000" + _ue(0) + "00" + _ue(0, 1)
    return _unit(0x65, head + block * blocks)


def _all_unchanged(count: int, blocks: int = WIDTH * HEIGHT) -> list[bytes]:
    return [_unchanged(number, blocks) for number in range(1, count + 1)]


def _unchanged(number: int, blocks: int) -> bytes:
    """All blocks are passed over."""
    head = _ue(0, 5, 0) + f"{number % 16:04b}000" + _ue(0, 1)
    return _unit(0x61, head + _ue(blocks))


def _ue(*values: int) -> str:
    """Whole numbers in Exp-Golomb code."""
    return "".join(f"{value + 1:b}".zfill(2 * (value + 1).bit_length() - 1) for value in values)


def _unit(head: int, bits: str) -> bytes:
    """A unit of the stream, in which no three bytes look like the begin of another."""
    bits += "1"
    bits += "0" * (-len(bits) % 8)
    out, zeros = bytearray(), 0
    for byte in int(bits, 2).to_bytes(len(bits) // 8):
        if zeros >= 2 and byte <= 3:
            out.append(3)
            zeros = 0
        out.append(byte)
        zeros = 0 if byte else zeros + 1
    return bytes([head]) + bytes(out)
