"""Hostile and damaged archives: one sentence each, no memory, nothing outside touched."""

import io
import os
import resource
import stat
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ico3d.bundle import archive, limits
from ico3d.bundle.format import Bundle
from ico3d.errors import BundleError

pytestmark = pytest.mark.slow

RELAXED = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])


def refused(path: Path, message: str | None = None) -> None:
    with pytest.raises(BundleError, match=message) as caught:
        Bundle.open(path)
    sentence = str(caught.value)
    assert "\n" not in sentence and sentence.endswith(".")


def repacked(data: bytes, change) -> bytes:
    """The same entries written by zipfile, each passed through `change(info, content)`."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        for info in old.infolist():
            for entry, content in change(info, old.read(info)):
                new.writestr(entry, content)
    return out.getvalue()


def named(name: str) -> zipfile.ZipInfo:
    return zipfile.ZipInfo(name)


@pytest.mark.parametrize(
    "name",
    [
        "../evil",
        "a/../../evil",
        "/etc/passwd",
        "C:\\evil",
        "a\\b",
        "",
        ".hidden",
        "a//b",
        "a/",
        "ä",
    ],
)
def test_an_entry_with_an_unsafe_name_is_refused(bundle_bytes, tmp_path, name):
    data = repacked(
        bundle_bytes, lambda i, c: [(i, c)] + [(named(name), b"")] * (i.filename[0] == "m")
    )
    path = tmp_path / "bad.ico3d"
    path.write_bytes(data)
    refused(path, "not allowed")
    assert [p.name for p in tmp_path.iterdir()] == ["bad.ico3d"]


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("second", ["head.safetensors", "HEAD.safetensors"])
def test_a_name_that_occurs_twice_is_refused(bundle_bytes, tmp_path, second):
    change = lambda i, c: [(i, c)] + [(named(second), c)] * (i.filename == "head.safetensors")  # noqa: E731
    path = tmp_path / "bad.ico3d"
    path.write_bytes(repacked(bundle_bytes, change))
    refused(path, "occurs twice")


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_compressed_entry_is_refused(bundle_bytes, tmp_path, method):
    def change(info, content):
        info.compress_type = method if info.filename == "speech.onnx" else zipfile.ZIP_STORED
        return [(info, content)]

    path = tmp_path / "bad.ico3d"
    path.write_bytes(repacked(bundle_bytes, change))
    refused(path, r"speech\.onnx: is compressed")


def test_a_link_in_a_zip_is_refused(bundle_bytes, tmp_path):
    def change(info, content):
        if info.filename == "thumbnail.png":
            info.external_attr = (stat.S_IFLNK | 0o777) << 16
            content = b"/etc/passwd"
        return [(info, content)]

    path = tmp_path / "bad.ico3d"
    path.write_bytes(repacked(bundle_bytes, change))
    refused(path, r"thumbnail\.png: links")


@pytest.mark.parametrize("target", ["/etc/passwd", "manifest.json"])
def test_a_link_in_a_folder_is_refused(bundle_folder, target):
    (bundle_folder / "thumbnail.png").unlink()
    (bundle_folder / "thumbnail.png").symlink_to(target)
    refused(bundle_folder, r"thumbnail\.png: links")


def test_a_linked_subfolder_is_refused(bundle_folder, tmp_path):
    (bundle_folder / "body").symlink_to(tmp_path)
    refused(bundle_folder, "body: links")


def test_a_pipe_in_a_folder_is_refused_without_waiting(bundle_folder):
    os.mkfifo(bundle_folder / "pipe")
    refused(bundle_folder, "pipe: is not a regular file")


def test_folders_nested_without_end_are_refused(bundle_folder):
    (bundle_folder / "a/b/c/d/e/f/g").mkdir(parents=True)
    refused(bundle_folder, "nested")


def test_too_many_files_are_refused(bundle_folder):
    for i in range(300):
        (bundle_folder / f"f{i}").touch()
    refused(bundle_folder, "more than 256 files")


def test_a_file_of_huge_size_is_refused_unread(bundle_folder):
    with (bundle_folder / "head.safetensors").open("r+b") as file:
        file.truncate(1 << 40)  # sparse
    refused(bundle_folder, r"head\.safetensors: is larger")


@pytest.mark.parametrize(("offset", "what"), [(10, "<H"), (12, "<L"), (16, "<L")])
def test_a_lying_end_record_is_refused(bundle_bytes, tmp_path, offset, what):
    """Entry count, directory size and directory start (zip end record)."""
    data = bytearray(bundle_bytes)
    struct.pack_into(what, data, len(data) - 22 + offset, 0xFFFF if what == "<H" else 0xFFFFFFFF)
    path = tmp_path / "bad.ico3d"
    path.write_bytes(data)
    refused(path)


def test_entries_that_overlap_are_refused(bundle_bytes, tmp_path):
    """Every directory entry points at the largest one: sizes add up to more than the file."""
    data = bytearray(bundle_bytes)
    with zipfile.ZipFile(io.BytesIO(bundle_bytes)) as archive:
        largest = max(archive.infolist(), key=lambda i: i.file_size)
    position = struct.unpack_from("<L", data, len(data) - 6)[0]
    while data[position : position + 4] == b"PK\1\2":
        struct.pack_into("<LL", data, position + 20, largest.file_size, largest.file_size)
        struct.pack_into("<L", data, position + 42, largest.header_offset)
        position += 46 + sum(struct.unpack_from("<HHH", data, position + 28))
    path = tmp_path / "bad.ico3d"
    path.write_bytes(data)
    refused(path)


@RELAXED
@given(st.data())
def test_a_truncated_bundle_is_refused(bundle_bytes, tmp_path, data):
    length = data.draw(st.integers(0, len(bundle_bytes) - 1))
    path = tmp_path / "bad.ico3d"
    path.write_bytes(bundle_bytes[:length])
    refused(path)


@RELAXED
@given(st.data())
def test_flipped_bytes_never_pass_as_another_avatar(bundle_bytes, tmp_path, data):
    """Either the damage is noticed, or it lies where nothing is read (zip bookkeeping)."""
    damaged = bytearray(bundle_bytes)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(
            st.integers(0, len(damaged) - 1) | st.integers(len(damaged) - 700, len(damaged) - 1)
        )
        damaged[place] ^= data.draw(st.integers(1, 255))
    good, bad = tmp_path / "good.ico3d", tmp_path / "bad.ico3d"
    good.write_bytes(bundle_bytes)
    bad.write_bytes(damaged)
    try:
        bundle = Bundle.open(bad)
    except BundleError:
        return
    original = Bundle.open(good)
    for name in original.manifest.files:
        assert bundle.read(name) == original.read(name)


@RELAXED
@given(st.binary(max_size=400))
def test_garbage_is_refused(tmp_path, data):
    path = tmp_path / "bad.ico3d"
    path.write_bytes(data)
    refused(path)


HUGE = """
import resource, sys
from ico3d.bundle.format import Bundle
from ico3d.errors import BundleError
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    Bundle.open(sys.argv[1])
except BundleError:
    pass
else:
    sys.exit("not refused")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def directory_bomb(path: Path) -> None:
    """100 MB of the smallest possible directory entries, which zipfile would keep in memory."""
    entry = struct.pack(
        "<4s4B4HL2L5H2L", b"PK\1\2", 20, 3, 20, 0, 0, 0, 0, 33, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0
    )
    count = (100 << 20) // (len(entry) + 1)
    with path.open("wb") as file:
        file.write((entry + b"a") * count)
        length = file.tell()
        file.write(
            struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count & 0xFF, count & 0xFF, length, 0, 0)
        )


def zip64_bomb(path: Path) -> None:
    """The same behind a zip64 end record, which overrides the plain one."""
    directory_bomb(path)
    size = path.stat().st_size - 22
    count = size // 47
    with path.open("r+b") as file:
        file.seek(size)
        file.write(struct.pack("<4sQ2H2L4Q", b"PK\6\6", 44, 45, 45, 0, 0, count, count, size, 0))
        file.write(struct.pack("<4sLQL", b"PK\6\7", 0, size, 1))
        file.write(struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, 76, size, 0))


def sparse_giant(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 38)


@pytest.mark.parametrize("make", [directory_bomb, zip64_bomb, sparse_giant])
def test_a_bomb_takes_no_memory(tmp_path, make):
    path = tmp_path / "bomb.ico3d"
    make(path)
    run = subprocess.run(
        [sys.executable, "-c", HUGE, str(path)], capture_output=True, text=True, timeout=60
    )
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) < 40


def test_maxrss_is_in_kilobytes_here():
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > 10_000


@pytest.mark.parametrize("name", ["LICENSES.txt", "thumbnail.png"])
def test_what_lies_beside_the_figure_is_small(tmp_path, name):
    archive._check_sizes({name: limits.MAX_ASIDE_BYTES, "head.safetensors": 1 << 27}, tmp_path)
    with pytest.raises(BundleError, match=f"{name}: is larger than"):
        archive._check_sizes({name: limits.MAX_ASIDE_BYTES + 1}, tmp_path)
