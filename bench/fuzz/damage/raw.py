"""Damages bytes and lines of which nothing is known."""

import struct
from random import Random

COUNTS = (0, 1, 2, 255, 65_535, 1 << 20, 1 << 24, (1 << 31) - 1, (1 << 32) - 1, (1 << 63) - 1)
WORDS = (b"nan", b"inf", b"-1", b"0", b"1e400", b"9" * 400, b"", b"\xff\xfe", b"\0", b"x", b"-1e-9")
WORDS += (b"99999999999", b"0.5", b"../../etc/passwd", b"\xed\xa0\x80", b"#", b'"', b"1_0", b"0x10")


def changed_bytes(data: bytes, random: Random) -> bytes:
    """One to four cuts, flips, forged numbers, moved and foreign pieces; half of them in front."""
    damaged = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 4))):
        _damage(damaged, random)
    return bytes(damaged)


def _damage(data: bytearray, random: Random) -> None:
    step, size = random.randrange(8), len(data)
    if step == 0 or not size:
        data[random.randrange(size + 1) :] = b""
        return
    at = random.randrange(min(size, 256) if random.random() < 0.5 else size)
    if step == 1:
        data[at] ^= 1 << random.randrange(8)
    elif step == 2:
        data[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF))
    elif step == 3:
        form = random.choice(("<H", ">H", "<I", ">I", "<I", ">I", "<Q", ">Q"))
        number = random.choice(COUNTS) & (256 ** struct.calcsize(form) - 1)
        data[at : at + struct.calcsize(form)] = struct.pack(form, number)
    elif step == 4:
        data[at : at + random.randrange(1, 40)] = random.randbytes(random.randrange(40))
    elif step == 5:
        del data[at : at + random.choice((1, 2, 4, 16, 100))]
    elif step == 6:
        piece = data[at : at + random.choice((1, 4, 16, 256))]
        data[at:at] = piece
    else:
        other = random.randrange(size)
        data[at : at + 32] = data[other : other + 32]


def changed_lines(data: bytes, random: Random) -> bytes:
    """One to three lines lost, doubled, exchanged, or with another word in them."""
    lines = data.split(b"\n")
    for _ in range(random.choice((1, 1, 2, 3))):
        at, step = random.randrange(len(lines)), random.randrange(6)
        if step == 0 and len(lines) > 1:
            del lines[at]
        elif step == 1:
            lines.insert(at, lines[at])
        elif step == 2:
            other = random.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        else:
            words = lines[at].split(b" ")
            words[random.randrange(len(words))] = random.choice(WORDS)
            lines[at] = b" ".join(words)
    return b"\n".join(lines)
