"""Heads of arrays are read as far as heads go, whatever length they state."""

import io
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest

from ico3d.capture.reading.arrays import read_numbers
from ico3d.common.unpacking.npy import LONGEST, array_head
from ico3d.common.unpacking.npz import read_npz
from ico3d.errors import CaptureError


def long_head(length: int) -> bytes:
    """An array whose head is filled up with blanks."""
    said = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1,)}".ljust(length - 1) + b"\n"
    return b"\x93NUMPY\x02\x00" + struct.pack("<I", length) + said + bytes(8)


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize("order", ["C", "F"])
def test_it_is_what_numpy_wrote(version, order):
    array, file = np.zeros((3, 4), np.float32, order), io.BytesIO()
    np.lib.format.write_array(file, array, version)
    file.seek(0)
    assert array_head(file) == ((3, 4), order == "F", np.dtype("f4"))
    assert file.tell() == len(file.getvalue()) - array.nbytes


def test_a_head_that_states_a_gigabyte_is_not_read():
    stream = io.BytesIO(long_head(LONGEST + 1))
    with pytest.raises(ValueError, match="too long"):
        array_head(stream)
    assert stream.tell() == 12
    assert array_head(io.BytesIO(long_head(LONGEST)))[0] == (1,)
    with pytest.raises(ValueError, match=r"version 9\.0"):
        array_head(io.BytesIO(b"\x93NUMPY\x09\x00" + bytes(8)))


def test_neither_a_packed_one_nor_a_hole_takes_memory(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", long_head(1 << 26))
    with (tmp_path / "a.npy").open("wb") as hole:
        hole.write(long_head(1 << 26)[:12])
        hole.truncate(1 << 26)
    tracemalloc.start()
    with pytest.raises(ValueError, match="too long"):
        read_npz(tmp_path / "a.npz", 1 << 40)
    with pytest.raises(CaptureError, match="no array of numbers"):
        read_numbers(tmp_path / "a.npy")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 20


def test_a_zip_is_no_array_of_a_recording(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.zeros(3))
    (tmp_path / "a.npz").rename(tmp_path / "a.npy")
    with pytest.raises(CaptureError, match="no array of numbers"):
        read_numbers(tmp_path / "a.npy")
