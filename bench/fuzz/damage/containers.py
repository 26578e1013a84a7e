"""Damages what lies within files of a known form, and writes the form around it anew."""

import ast
import gzip
import hashlib
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from fuzz.damage.raw import COUNTS, changed_bytes
from fuzz.damage.values import changed_tree, json_text

Inner = Callable[[str, bytes, Random], bytes]
"""Damages a file within a file by its name."""


def changed_safetensors(data: bytes, random: Random) -> bytes:
    """Another header of the right length, or other values, of a safetensors file."""
    (length,) = struct.unpack_from("<Q", data)
    header, values = json.loads(data[8 : 8 + length]), bytearray(data[8 + length :])
    step = random.randrange(4)
    if step == 0 and values:
        _forge_values(values, random)
    elif step == 1 and header.get("__metadata__"):
        name = random.choice(list(header["__metadata__"]))
        header["__metadata__"][name] = _inner_json(header["__metadata__"][name], random)
    elif step == 2:
        _reshape(header, random)
    else:
        header = changed_tree(header, random)
    text = json_text(header, random)
    return struct.pack("<Q", len(text)) + text + bytes(values)


def _inner_json(text: str, random: Random) -> str:
    """JSON within JSON."""
    try:
        tree = json.loads(text)
    except ValueError:
        return random.choice(("", "null", "[]", "{", "{}"))
    return json_text(changed_tree(tree, random), random).decode("utf-8", "replace")


def _forge_values(values: bytearray, random: Random) -> None:
    """NaN, infinity, huge, negative and zero numbers in the place of some."""
    for _ in range(random.choice((1, 1, 10, 1000))):
        at = random.randrange(len(values)) // 8 * 8
        forged = random.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff" * 8, b"\0" * 8, b"\x7f"))
        values[at : at + len(forged)] = forged[: len(values) - at]


def _reshape(header: dict[str, Any], random: Random) -> None:
    """The same bytes of a tensor as another shape or type, which the file still fits."""
    entry = header[random.choice([name for name in header if name != "__metadata__"])]
    if random.random() < 0.3:
        entry["dtype"] = random.choice(("F64", "F32", "F16", "I64", "I32", "U8", "BOOL", "BF16"))
        return
    count = int(np.prod(entry["shape"]))
    entry["shape"] = random.choice(([count], [1, count], [count, 1, 1], [count // 2, 2], [0, 4]))


def changed_zip(data: bytes, random: Random, inner: Inner) -> bytes:
    """A bundle in which a file is damaged and the manifest tells its new size and hash."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(random.choice((1, 1, 2))):
        name = random.choice(["manifest.json", *files])
        files[name] = inner(name, files[name], random)
    if random.random() < 0.1:
        files[random.choice(("a", "background.ply", "gestures.json", "../a"))] = b"\0" * 10
    if random.random() < 0.9:
        files["manifest.json"] = _relisted(files)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", random.choice((0, 0, 0, 0, 8))) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return out.getvalue()


def _relisted(files: dict[str, bytes]) -> bytes:
    """The manifest with sizes and hashes of the files as they are."""
    try:
        manifest = json.loads(files["manifest.json"])
        for name, entry in manifest["files"].items():
            entry["size"] = len(files[name])
            entry["sha256"] = hashlib.sha256(files[name]).hexdigest()
        return json.dumps(manifest).encode()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return files["manifest.json"]


def changed_gzip(data: bytes, random: Random) -> bytes:
    """A gzip stream with a right checksum around damaged bytes."""
    return gzip.compress(changed_bytes(gzip.decompress(data), random), 1)


def changed_png(data: bytes, random: Random) -> bytes:
    """A PNG of another claimed size, depth or kind, whose header is sound."""
    header = bytearray(data[16:29])
    if random.random() < 0.6:
        side = random.choice((0, 1, 2, 1000, 12_000, 20_000, 1 << 30, (1 << 32) - 1))
        struct.pack_into(">I", header, random.choice((0, 4)), side)
    else:
        header[random.randrange(8, 13)] = random.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
    checksum = struct.pack(">I", zlib.crc32(b"IHDR" + header))
    return data[:16] + bytes(header) + checksum + data[33:]


def changed_npy(data: bytes, random: Random) -> bytes:
    """An array file with another header: shape, type, order, or no dictionary at all."""
    end = 10 + struct.unpack_from("<H", data, 8)[0]
    known = ast.literal_eval(data[10:end].decode())
    step = random.randrange(4)
    if step == 0:
        known["shape"] = random.choice(
            ((), (0,), (1 << 40,), (-1,), (3, 1 << 30), known["shape"] * 2)
        )
    elif step == 1:
        known["descr"] = random.choice(("|O", "<f8", "<f2", "<U4", "|b1", "<c16", "<M8[s]", "nope"))
    elif step == 2:
        known[random.choice(("shape", "descr", "fortran_order", "more"))] = random.choice(
            (None, 1, "a")
        )
    else:
        values = bytearray(data[end:])
        if values:
            _forge_values(values, random)
        return data[:end] + bytes(values)
    text = repr(known).encode() + b"\n"
    return data[:8] + struct.pack("<H", len(text)) + text + data[end:]


def changed_wav(data: bytes, random: Random) -> bytes:
    """A WAV file whose header claims other numbers."""
    damaged = bytearray(data)
    place, form = random.choice(
        ((4, "<I"), (16, "<I"), (20, "<H"), (22, "<H"), (24, "<I"), (32, "<H"), (40, "<I"))
    )
    number = random.choice((*COUNTS, 3, 8, 12, 24, 8000, 16_000, 384_000))
    struct.pack_into(form, damaged, place, number & (256 ** struct.calcsize(form) - 1))
    return bytes(damaged)
