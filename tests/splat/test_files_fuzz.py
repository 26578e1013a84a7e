"""2,000 damaged files: each is read or refused in one sentence, soon, and in bounded memory."""

import gzip
import struct
import time
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.common.spz.container import FREE_BYTES
from ico3d.errors import GaussianFileError
from ico3d.splat.files.formats import read_gaussians, write_gaussians
from support.splats.gaussian_files import as_gsply, gsply, ply_bytes, random_gaussians, splat_bytes

pytestmark = pytest.mark.slow

EXAMPLES = 250  # for each of the eight formats
MAX_SECONDS = 2
MAX_MEMORY_PER_BYTE = 10
FREE_MEMORY = FREE_BYTES + (1 << 17)
"""What any file may take: unpacked SPZ data of tiny files, the header, a block of 4096 rows."""

COUNTS = [0, 1, 255, 257, 1 << 16, (1 << 24) + 1, (1 << 31) - 1, (1 << 32) - 1]


def ascii_ply(gaussians, folder):
    data = ply_bytes(gaussians, folder)
    head, body = data.split(b"end_header\n", 1)
    head = head.replace(b"binary_little_endian", b"ascii") + b"end_header\n"
    values = struct.unpack(f"<{len(body) // 4}f", body)
    return head + b"\n".join(b"%.6g" % value for value in values)


def big_endian_ply(gaussians, folder):
    data = ply_bytes(gaussians, folder)
    head, body = data.split(b"end_header\n", 1)
    values = struct.unpack(f"<{len(body) // 4}f", body)
    head = head.replace(b"little", b"big") + b"end_header\n"
    return head + struct.pack(f">{len(values)}f", *values)


def written(gaussians, folder, name, write):
    write(gaussians, folder / name)
    return (folder / name).read_bytes()


def compressed_ply(gaussians, folder):
    path = folder / "c.compressed.ply"
    gsply.plywrite(str(path), as_gsply(gaussians), compressed=True)
    return path.read_bytes()


def spz_4(gaussians, folder):
    gsply.write_spz(folder / "4.spz", as_gsply(gaussians), version=4)
    return (folder / "4.spz").read_bytes()


def spz_3(gaussians, folder):
    return written(gaussians, folder, "3.spz", lambda g, path: write_gaussians(path, g))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One sound file of each format, 20 to 200 KB."""
    folder = tmp_path_factory.mktemp("whole")
    many, few = random_gaussians(700, 3), random_gaussians(1500, 0)
    return {
        "ply 3": ply_bytes(many, folder),
        "ply 0": big_endian_ply(few, folder),
        "ply ascii": ascii_ply(few, folder),
        "compressed ply": compressed_ply(many, folder),
        "compressed ply 0": compressed_ply(few, folder),
        "spz 3": spz_3(many, folder),
        "spz 4": spz_4(many, folder),
        "splat": splat_bytes(few),
    }


@st.composite
def damages(draw):
    """A function that damages a file: several of cuts, flips, forged counts, foreign bytes."""
    steps = draw(
        st.lists(st.sampled_from(["cut", "flip", "count", "splice"]), min_size=1, max_size=3)
    )
    # Half of all damage lies where the headers are.
    place = st.one_of(st.floats(0, 0.02), st.floats(0, 1))
    inside = draw(st.booleans())  # of a gzip stream, so that its checksum is right

    def apply(data, values):
        data = bytearray(data)
        for step, where, number, foreign in values:
            at = max(4, int(where * len(data)))  # what tells the format, stays
            if step == "cut":
                del data[at:]
            elif step == "flip" and data:
                data[min(at, len(data) - 1)] ^= 1 << number % 8
            elif step == "count":
                _forge_count(data, COUNTS[number % len(COUNTS)])
            elif step == "splice":
                data[at : at + len(foreign)] = foreign
        return bytes(data)

    values = [
        (step, draw(place), draw(st.integers(0, 63)), draw(st.binary(max_size=40)))
        for step in steps
    ]

    def damage(data):
        if inside and data[:2] == b"\x1f\x8b":
            return gzip.compress(apply(gzip.decompress(data), values), 1)
        return apply(data, values)

    return damage


def _forge_count(data, count):
    """Puts another number of Gaussians into a header."""
    if data[:4] == b"NGSP":
        data[8:12] = struct.pack("<I", count)
    start = data.find(b"element vertex ")
    if start >= 0:
        end = data.find(b"\n", start)
        data[start:end] = b"element vertex %d" % count


def check(path):
    """Reads a file: fine, or refused in one sentence; in time and memory."""
    size = path.stat().st_size
    tracemalloc.start()
    start = time.process_time()
    try:
        read_gaussians(path).checked()
    except GaussianFileError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error)
    finally:
        seconds = time.process_time() - start
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert seconds < MAX_SECONDS, path
    assert peak <= MAX_MEMORY_PER_BYTE * size + FREE_MEMORY, path


def test_damaged_files_are_read_or_refused(tmp_path, whole):
    """Each damage is done to every format: drawing one takes longer than reading its files."""
    paths = {kind: tmp_path / f"{kind}.{_suffix(kind)}" for kind in whole}
    for kind, path in paths.items():
        path.write_bytes(whole[kind])
        read_gaussians(path)  # sound before it is damaged
        check(path)

    @given(damages())
    @settings(max_examples=EXAMPLES, derandomize=True, database=None)
    def run(damage):
        for kind, path in paths.items():
            path.write_bytes(damage(whole[kind]))
            check(path)

    run()


def _suffix(kind):
    """Only one format is told by the name of its files."""
    return "splat" if kind == "splat" else "bin"


@pytest.mark.parametrize("begin", [b"", b"ply\n", b"ply\nformat ascii 1.0\n", b"\x1f\x8b", b"NGSP"])
def test_noise_is_refused(tmp_path, begin):
    @given(st.binary(max_size=3000))
    @settings(max_examples=20, derandomize=True, database=None)
    def run(noise):
        (tmp_path / "noise").write_bytes(begin + noise)
        check(tmp_path / "noise")

    run()
