"""What is packed in SMC files: honest data sets are read, bombs are refused unread."""

import resource
import time
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError
from support.recordings import dna_files

DEFLATE = h5py.h5z.FILTER_DEFLATE
MIB = 1 << 20


def packed(group: h5py.Group, name: str, size: int, data: bytes, filters: tuple[int, ...]) -> None:
    """Writes (size,) uint8 as one piece of whatever was packed."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((size,))
    for number in filters:
        plan.set_filter(number, h5py.h5z.FLAG_MANDATORY, (9,) if number == DEFLATE else ())
    space = h5py.h5s.create_simple((size,))
    made = h5py.h5d.create(group.id, name.encode(), h5py.h5t.NATIVE_UINT8, space, plan)
    made.write_direct_chunk((0,), data)


def zeros(mebibytes: int, first: bytes = b"") -> bytes:
    """So many packed zeros, behind some first bytes; one piece, packed once, again and again."""
    packing, piece = zlib.compressobj(9, wbits=-zlib.MAX_WBITS), bytes(MIB)
    head = packing.compress(first) + packing.flush(zlib.Z_FULL_FLUSH)
    packed_piece = packing.compress(piece) + packing.flush(zlib.Z_FULL_FLUSH)
    check = zlib.adler32(first)
    for _ in range(mebibytes):
        check = zlib.adler32(piece, check)
    end = packing.flush() + check.to_bytes(4)
    return b"\x78\xda" + head + mebibytes * packed_piece + end


def refused(read, inside: str) -> None:
    """Refused in a sentence, and without memory for what would have come of it."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(CaptureError, match=f"{inside} is damaged"):
        read(inside)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10  # kB


@pytest.mark.parametrize(
    "how",
    (
        {"compression": "gzip"},
        {"compression": "gzip", "shuffle": True},
        {"compression": "gzip", "shuffle": True, "fletcher32": True},
        {"shuffle": True, "fletcher32": True},
        {"chunks": (70, 3)},
    ),
)
def test_packed_tables_and_pictures_are_read(tmp_path: Path, how: dict) -> None:
    table = np.random.default_rng(1).normal(size=(1000, 3))
    picture = dna_files.encoded(dna_files.picture(0, 0, (48, 40)), "JPEG")
    about = {k: v for k, v in how.items() if k != "chunks"}
    with h5py.File(tmp_path / "a.smc", "w") as file:
        file.create_dataset("table", data=table, **how)
        file.create_dataset("zeros", data=np.zeros((1000, 300)), **about)
        file.create_dataset("picture", data=picture, **about)
    opened = SmcFile(tmp_path / "a.smc")
    np.testing.assert_array_equal(opened.numbers("table", (None, 3)), table)
    np.testing.assert_array_equal(opened.numbers("zeros", None), np.zeros((1000, 300)))
    assert opened.encoded("picture") == picture.tobytes()
    assert opened.head("picture", 4) == picture.tobytes()[:4]


def test_pieces_that_packing_did_not_shrink_are_read(tmp_path: Path) -> None:
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((5,))
    plan.set_deflate(9)
    with h5py.File(tmp_path / "a.smc", "w") as file:
        space = h5py.h5s.create_simple((5,))
        made = h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_UINT8, space, plan)
        made.write_direct_chunk((0,), b"plain", filter_mask=1)
    opened = SmcFile(tmp_path / "a.smc")
    assert opened.encoded("x") == b"plain" and opened.head("x", 4) == b"plai"


def test_pieces_of_which_more_comes_than_they_say_are_refused(tmp_path: Path) -> None:
    bomb = zeros(512)
    with h5py.File(tmp_path / "a.smc", "w") as file:
        packed(file, "once", 1024, bomb, (DEFLATE,))
        packed(file, "twice", 1024, zlib.compress(bomb), (DEFLATE, DEFLATE))
        packed(file, "swapped", 1024, bomb, (DEFLATE, h5py.h5z.FILTER_SHUFFLE))
        packed(file, "long", MIB, zeros(512), (h5py.h5z.FILTER_SHUFFLE, DEFLATE))
        packed(file, "cut", 1024, bomb[:100], (DEFLATE,))
        packed(file, "lzf", 1024, bytes(50), (h5py.h5z.FILTER_LZF,))
    opened = SmcFile(tmp_path / "a.smc")
    for name in ("once", "twice", "swapped", "long", "cut", "lzf"):
        refused(opened.encoded, name)
    assert opened.head("once", 4) == bytes(4)  # no more than these is unpacked
    refused(lambda name: opened.head(name, 4), "twice")


def test_much_from_little_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.smc", "w") as file:
        packed(file, "packed", 200 * MIB, zeros(200), (DEFLATE,))
        file.create_dataset("unwritten", (200 * MIB,), "u1")
    opened = SmcFile(tmp_path / "a.smc")
    refused(opened.encoded, "packed")
    refused(opened.encoded, "unwritten")


def test_pictures_larger_than_any_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.smc", "w") as file:
        file["large"] = np.ones(65 * MIB, np.uint8)
    refused(SmcFile(tmp_path / "a.smc").encoded, "large")


def test_attributes_are_a_few_numbers_or_one_word(tmp_path: Path) -> None:
    words = h5py.string_dtype()
    with h5py.File(tmp_path / "a.smc", "w") as file:
        file.attrs.update(number=3, numbers=np.zeros(512), word="female", fixed=np.bytes_("f" * 9))
        file.attrs.update(many=np.zeros(513), long=np.bytes_("f" * 5000))
        file.attrs.create("words", ["a", "a"], dtype=words)
        rows = np.empty(2, object)
        rows[:] = np.zeros(2, np.uint8), np.zeros(3, np.uint8)
        file.attrs.create("rows", rows, dtype=h5py.vlen_dtype(np.uint8))
    opened = SmcFile(tmp_path / "a.smc")
    assert opened.attribute("", "number") == 3 and opened.attribute("", "word") == "female"
    assert len(opened.attribute("", "numbers")) == 512
    assert opened.attribute("", "fixed") == b"f" * 9 and opened.attribute("", "none") is None
    for name in ("many", "long", "words", "rows"):
        refused(lambda inside, name=name: opened.attribute(inside, name), "")


def test_a_picture_linked_a_thousand_times_is_checked_at_once(tmp_path: Path) -> None:
    rig = dna_files.Rig(cameras=(0, 1, 2, 48), annotated=False)
    main, frames, size = dna_files.write_recording(tmp_path, rig), 400, 200 * MIB
    with h5py.File(main, "a") as file:
        packed(file, "x", size, zeros(200, b"\xff\xd8\xff"), (DEFLATE,))
        for group, numbers in dna_files.groups(rig).items():
            file[group].attrs["num_frame"] = frames
            for camera in numbers:
                for frame in range(rig.frames, frames):
                    file[f"{group}/{camera}/color/{frame}"] = file["x"]
    start = time.process_time()
    (views,) = (f for f in open_capture(main).inspect() if f.what == "views")
    assert time.process_time() - start < 5  # one of them takes half a second
    assert views.level == "ok"
