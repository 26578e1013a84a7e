"""Archives of many entries are refused before their directories are read."""

import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
import torch

from ico3d.common.unpacking.npz import read_npz
from ico3d.common.unpacking.weights import check_unpacked
from ico3d.common.unpacking.zips import MOST_ENTRIES, OtherEndError, directory
from ico3d.errors import ModelError

ENTRY = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", 20, 3, 20, *[0] * 8, 1, *[0] * 6) + b"a"


def crowd(path, stated, far, entries=1 << 18):
    """An archive of many entries of the name 'a', which takes a hundred times its size."""
    head, length = b"PK\3\4" + bytes(26), entries * len(ENTRY)
    with path.open("wb") as file:
        file.write(head + ENTRY * entries)
        if far:
            place = file.tell()
            ends = (stated, stated, length, len(head))
            file.write(struct.pack("<4sQ2H2L4Q", b"PK\6\6", 44, 45, 45, 0, 0, *ends))
            file.write(struct.pack("<4sLQL", b"PK\6\7", 0, place, 1))
            stated = length = 0
        file.write(struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, stated, stated, length, len(head), 0))
    return path


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("stated", [1, 60_000])
def test_an_archive_of_many_entries_is_refused_unread(tmp_path, stated, far):
    file = crowd(tmp_path / "a.npz", stated, far)
    with zipfile.ZipFile(file) as archive:
        assert len(archive.infolist()) == 1 << 18
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=f"more than {MOST_ENTRIES:,} entries"):
            read_npz(file, 1 << 20)
        with pytest.raises(ModelError, match=f"more than {MOST_ENTRIES:,} entries"):
            check_unpacked(file)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_a_record_that_readers_look_for_in_two_places_is_refused(tmp_path):
    file = crowd(tmp_path / "a.npz", 1, far=True, entries=1)
    data = bytearray(file.read_bytes())
    data[-34:-26] = bytes(8)  # where the locator says that the record is
    file.write_bytes(data)
    with file.open("rb") as opened, pytest.raises(OtherEndError, match="not where it should be"):
        directory(opened)


def test_what_numpy_and_torch_write_is_found(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.zeros(3), b=np.zeros(4))
    torch.save({"x": torch.zeros(3)}, tmp_path / "a.pth")
    for name in ("a.npz", "a.pth"):
        with (tmp_path / name).open("rb") as file:
            found = directory(file)
            assert file.tell() == 0
        with zipfile.ZipFile(tmp_path / name) as archive:
            assert found.count == len(archive.infolist())
        assert found.start + found.length == found.end
        assert found.far == (name == "a.pth")
