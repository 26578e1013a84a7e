"""A film whose pictures take 18 bytes each and cost as much as any of 8192 × 4320 pixels."""

import io
from fractions import Fraction
from pathlib import Path

import av

WIDTH, HEIGHT = 512, 270
"""In blocks of 16 pixels."""


def write_empty_pictures(path: Path, count: int) -> None:
    """H.264 of one grey picture and `count` that change nothing of it."""
    units = [_sequence(), _picture(), _grey(), *(_unchanged(n) for n in range(1, count + 1))]
    raw = io.BytesIO(b"".join(b"\0\0\0\1" + unit for unit in units))
    with av.open(raw, format="h264") as given, av.open(str(path), "w") as made:
        stream = made.add_stream_from_template(given.streams.video[0])
        for number, packet in enumerate(one for one in given.demux() if one.size):
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            packet.pts = packet.dts = number
            made.mux(packet)


def _sequence() -> bytes:
    bits = f"{66:08b}{0:08b}{62:08b}" + _ue(0, 0, 2, 1) + "0" + _ue(WIDTH - 1, HEIGHT - 1)
    return _unit(0x67, bits + "1100")


def _picture() -> bytes:
    return _unit(0x68, _ue(0, 0) + "00" + _ue(0, 0, 0) + "000" + _ue(0, 0, 0) + "100")


def _grey() -> bytes:
    """Blocks that are predicted from nothing, without a remainder."""
    head = _ue(0, 7, 0) + "0000" + _ue(0) + "00" + _ue(0, 1)
    return _unit(0x65, head + "00100111" * (WIDTH * HEIGHT))


def _unchanged(number: int) -> bytes:
    """All blocks are passed over."""
    head = _ue(0, 5, 0) + f"{number % 16:04b}000" + _ue(0, 1)
    return _unit(0x61, head + _ue(WIDTH * HEIGHT))


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
