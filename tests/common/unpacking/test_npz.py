"""Arrays of a file that unpacks to far more than its size are not unpacked."""

import io
import tracemalloc
import zipfile

import numpy as np
import pytest

from ico3d.body.planning import flow
from ico3d.capture.posing.smplx.model_file import read_model
from ico3d.common.unpacking.npz import LackingError, TooLargeError, read_npz
from ico3d.errors import CaptureError
from ico3d.studio.person.npz_person import load_npz


@pytest.fixture
def peak():
    """Tells the largest number of bytes that were taken at once."""
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()


def write(path, **arrays):
    np.savez_compressed(path, **arrays)
    return path


def test_arrays_are_those_that_were_written(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3), "names": np.array(["x", "yz"]), "n": np.array(3)}
    file = write(tmp_path / "a.npz", **arrays)
    for names in (None, ("a", "n")):
        found = read_npz(file, 100, names)
        assert list(found) == list(names or arrays)
        for name, array in found.items():
            np.testing.assert_array_equal(array, arrays[name])
    with pytest.raises(LackingError, match=r"^b$"):
        read_npz(file, 100, ("a", "b"))


@pytest.mark.parametrize("kind", ["u1", "f2", "f8"])
def test_small_numbers_count_as_large_ones(tmp_path, kind):
    file = write(tmp_path / "a.npz", a=np.zeros(1000, kind))
    assert len(read_npz(file, 8000)["a"]) == 1000
    with pytest.raises(TooLargeError):
        read_npz(file, 7999)


def test_what_a_head_claims_is_not_believed(tmp_path, peak):
    head = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (1 << 25,)}
    np.lib.format.write_array_header_1_0(head, claim)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", head.getvalue() + bytes(64))
    with pytest.raises(ValueError):
        read_npz(tmp_path / "a.npz", 1 << 40)
    assert peak() < 1 << 20


def test_a_model_of_bytes_is_not_unpacked(tmp_path, peak):
    """Its bytes would become numbers of 64 bits."""
    count = 1 << 18
    heads = {"J_regressor": (55, count), "weights": (count, 55), "shapedirs": (count, 3, 20)}
    heads |= {"v_template": (count, 3), "kintree_table": (2, 55), "f": (1, 3)}
    arrays = {name: np.zeros(shape, "u1") for name, shape in heads.items()}
    hands = {f"hands_mean{side}": np.zeros(45, "u1") for side in "lr"}
    file = write(tmp_path / "model.npz", **arrays, **hands)
    del arrays
    assert file.stat().st_size < 200_000
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    with pytest.raises(CaptureError, match="arrays are larger than those of SMPL-X"):
        read_model(file)
    assert peak() - before < 1 << 20


def test_a_subject_of_much_is_not_unpacked(tmp_path, peak):
    file = write(tmp_path / "a.npz", verts=np.zeros(1 << 26, "u1"))
    tracemalloc.reset_peak()
    with pytest.raises(CaptureError, match="larger than is taken"):
        load_npz(file)
    assert peak() < 1 << 20


@pytest.mark.parametrize(
    ("vertices", "shapes", "joints"), [(1 << 20, 1, 1), (100_000, 3000, 1), (100_000, 1, 3000)]
)
def test_a_subject_of_many_shapes_or_joints_is_refused(tmp_path, vertices, shapes, joints):
    """Each would have a row of numbers for all vertices: 3.6 GB in the second case."""
    names = {"bs_names": np.zeros(shapes, "U1"), "joint_names": np.zeros(joints, "U1")}
    file = write(tmp_path / "a.npz", verts=np.zeros((vertices, 3), "u1"), **names)
    with pytest.raises(CaptureError, match=f"{shapes} shapes and {joints} joints of {vertices}"):
        load_npz(file)


def test_a_subject_of_many_triangles_or_influences_is_refused(tmp_path):
    """Each edge would get a row of numbers for all shapes, each influence one of a joint."""
    names = {"bs_names": np.zeros(300, "U1"), "joint_names": np.zeros(2, "U1")}
    names |= {"vis_names": np.zeros(15, "U1"), "part_names": np.array(["shirt", "skin"])}
    names["face_part"] = np.zeros(60_000, "u1")
    arrays = names | {"verts": np.zeros((500, 3), "u1"), "w_idx": np.zeros((500, 4), "u1")}
    arrays |= {"faces": np.zeros((60_000, 3), "u2"), "w_val": np.zeros((500, 4), "f2")}
    with pytest.raises(CaptureError, match="300 shapes of 300000 triangles are more than is taken"):
        load_npz(write(tmp_path / "a.npz", **arrays))
    arrays |= {name: arrays[name][:10] for name in ("faces", "face_part")}
    spoken = arrays | {"vis_names": np.zeros(1001, "U1")}
    with pytest.raises(CaptureError, match="more than 1000 shapes, joints or visemes"):
        load_npz(write(tmp_path / "d.npz", **spoken))
    wide = arrays | {name: np.zeros((500, 17), "u1") for name in ("w_idx", "w_val")}
    with pytest.raises(CaptureError, match="more than 16 joints each"):
        load_npz(write(tmp_path / "b.npz", **wide))
    odd = arrays | {"w_val": np.zeros((500, 3), "f2")}
    with pytest.raises(CaptureError, match="more than 16 joints each"):
        load_npz(write(tmp_path / "c.npz", **odd))


def test_a_cached_flow_of_more_than_was_measured_is_damaged(tmp_path, peak):
    file = write(tmp_path / "a.npz", energy=np.zeros(3), moving=np.zeros((3, 1 << 24), "u1"))
    tracemalloc.reset_peak()
    assert flow._load(file, 3 * (1 + 40)) is None
    assert peak() < 1 << 20
    write(file, energy=np.ones(3), moving=np.zeros((3, 8, 5), "u1"))
    found = flow._load(file, 3 * (1 + 40))
    assert found is not None and found[1].shape == (3, 8, 5)
