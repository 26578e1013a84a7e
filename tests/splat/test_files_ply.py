import shutil
import time
import tracemalloc

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from ico3d.common.files import SPARE
from ico3d.errors import GaussianFileError, StorageError
from ico3d.splat.files.formats import read_file, read_gaussians, write_gaussians
from ico3d.splat.files.raw import RawGaussians
from ico3d.splat.files.standard_ply import header, property_order
from ico3d.splat.gaussians import Gaussians
from support.splats.gaussian_files import as_gsply, gsply, ply_bytes, random_gaussians, same

pytestmark = pytest.mark.slow

FINITE = st.floats(width=32, allow_nan=False, allow_infinity=False)
SCALES = st.floats(width=32, max_value=80, allow_nan=False, allow_infinity=False)


@st.composite
def files(draw):
    """Bytes of a PLY as the original code writes it, of any finite floats whatever."""
    degree, count = draw(st.integers(0, 3)), draw(st.integers(0, 5))
    names = property_order(degree)
    table = draw(npst.arrays("<f4", (count, len(names)), elements=FINITE))
    columns = [index for index, name in enumerate(names) if name.startswith("scale_")]
    table[:, columns] = draw(npst.arrays("<f4", (count, 3), elements=SCALES))
    return degree, count, header(count, degree) + table.tobytes()


@given(files())
@settings(max_examples=200)
def test_what_is_read_and_written_again_is_the_same_to_the_last_bit(tmp_path_factory, file):
    degree, count, data = file
    folder = tmp_path_factory.mktemp("ply")
    (folder / "a.ply").write_bytes(data)
    gaussians = read_gaussians(folder / "a.ply")
    assert (gaussians.degree, len(gaussians)) == (degree, count)
    write_gaussians(folder / "b.ply", gaussians)
    assert (folder / "b.ply").read_bytes() == data


@pytest.mark.parametrize("degree", range(4))
def test_a_second_library_reads_the_same_values(tmp_path, degree):
    gaussians = random_gaussians(100, degree)
    write_gaussians(tmp_path / "a.ply", gaussians)
    other = gsply.plyread(tmp_path / "a.ply")
    assert np.array_equal(other.means, gaussians.means)
    assert np.array_equal(other.scales, gaussians.log_scales)
    assert np.array_equal(other.quats, gaussians.quats)
    assert np.array_equal(other.opacities, gaussians.opacities)
    assert np.array_equal(other.sh0, gaussians.dc)
    if degree:
        assert np.array_equal(other.shN, gaussians.rest)


def test_files_without_normals_are_read_and_get_zeros(tmp_path):
    gaussians = random_gaussians(10, 2)
    gsply.plywrite(str(tmp_path / "a.ply"), as_gsply(gaussians))
    read = read_gaussians(tmp_path / "a.ply")
    assert read.normals is None
    write_gaussians(tmp_path / "b.ply", read)
    assert np.array_equal(read_gaussians(tmp_path / "b.ply").normals, np.zeros((10, 3)))


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_columns_in_any_order_type_and_company(tmp_path, form):
    gaussians = random_gaussians(50, 1)
    plain = np.frombuffer(ply_bytes(gaussians, tmp_path)[len(header(50, 1)) :], "<f4")
    plain = plain.reshape(50, -1)
    names = property_order(1)
    order = np.random.default_rng(0).permutation(len(names))
    types = {0: ("double", "f8"), 1: ("float32", "f4"), 2: ("float", "f4")}
    lines = ["ply", f"format {form} 1.0", "comment made for a test", "element camera 2"]
    lines += ["property short id", "element vertex 50", "property uchar red"]
    lines += [f"property {types[i % 3][0]} {names[i]}" for i in order]
    lines += ["element face 1", "property list uchar int vertex_index", "end_header"]
    text = ("\r\n" if form == "ascii" else "\n").join([*lines, ""]).encode()
    mark = ">" if form == "binary_big_endian" else "<"
    row = np.dtype([("red", "u1"), *((names[i], mark + types[i % 3][1]) for i in order)])
    table = np.zeros(50, row)
    for index, name in enumerate(names):
        table[name] = plain[:, index]
    if form == "ascii":
        body = "1\n2\n" + "\n".join(" ".join(repr(float(v)) for v in row) for row in table) + "\n0"
        data = text + body.encode()
    else:
        data = text + np.array([1, 2], mark + "i2").tobytes() + table.tobytes() + b"\0"
    (tmp_path / "a.ply").write_bytes(data)
    assert same(read_gaussians(tmp_path / "a.ply"), gaussians)


def test_raw_parameters_and_activated_gaussians(tmp_path):
    raw = random_gaussians(100, 3)
    active = raw.to_gaussians()
    assert torch.equal(active.scales, torch.tensor(raw.log_scales).exp())
    assert torch.equal(active.opacities, torch.tensor(raw.opacities).sigmoid())
    again = RawGaussians.from_gaussians(active)
    assert np.array_equal(again.means, raw.means) and np.array_equal(again.quats, raw.quats)
    assert np.array_equal(again.dc, raw.dc) and np.array_equal(again.rest, raw.rest)
    assert np.allclose(again.log_scales, raw.log_scales, atol=1e-6)
    assert np.allclose(again.to_gaussians().opacities, active.opacities, atol=2e-6)


def test_plain_colours_and_certain_opacities_become_finite_parameters():
    colors = torch.tensor([[0.0, 0.5, 1.0], [0.2, 0.3, 0.4]])
    opacities, scales = torch.tensor([0.0, 1.0]), torch.tensor([[0.0, 0.1, 1], [1, 2, 3]])
    raw = RawGaussians.from_gaussians(
        Gaussians(torch.zeros(2, 3), torch.ones(2, 4), scales, opacities, colors=colors)
    ).checked()
    assert raw.degree == 0
    back = raw.to_gaussians()
    assert back.sh is not None
    assert torch.allclose(0.5 + 0.28209479177387814 * back.sh[:, 0], colors, atol=1e-6)
    assert torch.allclose(back.opacities, opacities, atol=1.1e-6)
    assert torch.allclose(back.scales, scales, atol=1e-6)


def test_infinite_logits_that_other_tools_write_are_opaque(tmp_path):
    raw = random_gaussians(3, 0)
    raw.opacities[:] = [np.inf, -np.inf, 0]
    raw.log_scales[2, 1] = -np.inf
    write_gaussians(tmp_path / "a.ply", raw)
    read = read_gaussians(tmp_path / "a.ply")
    assert read.to_gaussians().opacities.tolist() == [1, 0, 0.5]
    write_gaussians(tmp_path / "a.spz", read)
    assert np.allclose(
        read_gaussians(tmp_path / "a.spz").to_gaussians().opacities, [1, 0, 0.5], atol=2e-3
    )


@pytest.mark.parametrize(
    "field, where, value, says",
    [
        ("means", (7, 1), np.nan, "Gaussian 7 has the y nan"),
        ("quats", (3, 2), np.inf, "Gaussian 3 has the rot_2 inf"),
        ("opacities", (9,), np.nan, "Gaussian 9 has the opacity nan"),
        ("log_scales", (0, 0), 89, "Gaussian 0 has the scale_0 89"),
        ("rest", (5, 2, 1), -np.inf, "Gaussian 5 has the f_rest_10 -inf"),
        ("normals", (4, 2), np.nan, "Gaussian 4 has the nz nan"),
    ],
)
def test_values_that_are_no_numbers_are_named(tmp_path, field, where, value, says):
    raw = random_gaussians(10, 2)
    getattr(raw, field)[where] = value
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw, tmp_path))
    with pytest.raises(GaussianFileError, match=f"a.ply: {says}"):
        read_gaussians(tmp_path / "a.ply")
    with pytest.raises(GaussianFileError, match=says):
        write_gaussians(tmp_path / "b.ply", raw)
    assert not (tmp_path / "b.ply").exists()


GOOD_HEADER = header(2, 0).decode()


@pytest.mark.parametrize(
    "damage, says",
    [
        (lambda h: h[:-20], "header does not end within its first"),
        (lambda h: h.replace("float x", "float96 x"), "unknown line at byte 53"),
        (lambda h: h.replace("float y", "float x"), "unknown line at byte 70"),
        (lambda h: h.replace("vertex 2", "vertex -2"), "unknown line at byte 36"),
        (lambda h: h.replace("binary_little", "middle"), "no known format before byte"),
        (lambda h: h.replace("vertex 2", "vertex 3"), "3 rows of 'vertex' from byte"),
        (lambda h: h.replace("vertex 2", "vertex 1"), "by its header the file ends at byte"),
        (lambda h: h.replace("vertex 2", "vertex 999999999999"), "but the file ends at byte"),
        (lambda h: h.replace("vertex", "vortex"), "no table 'vertex'"),
        (lambda h: h.replace("f_dc_1", "f_dc_7"), "lacks the property f_dc_1"),
        (lambda h: h.replace("float nx", "float f_rest_0"), "1 properties f_rest_"),
        (lambda h: "ply\ncomment " + "x" * 70000 + h[3:], "65536 bytes"),
    ],
)
def test_damaged_headers_are_refused_with_the_byte(tmp_path, damage, says):
    (tmp_path / "a.ply").write_bytes(damage(GOOD_HEADER).encode() + bytes(2 * 17 * 4))
    with pytest.raises(GaussianFileError, match=says):
        read_gaussians(tmp_path / "a.ply")


def test_text_that_is_no_number_is_refused(tmp_path):
    head = GOOD_HEADER.replace("binary_little_endian", "ascii")
    for body in ("1 " * 33 + "one", "1 " * 33, "1 " * 5):
        (tmp_path / "a.ply").write_text(head + body)
        with pytest.raises(GaussianFileError, match=f"from byte {len(head)} on|between byte"):
            read_gaussians(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_text(head + "1 " * 34)
    assert read_file(tmp_path / "a.ply").kind == "PLY"


def test_large_files_are_read_fast_and_in_little_memory(tmp_path):
    path = tmp_path / "a.ply"
    write_gaussians(path, random_gaussians(200_000, 3))
    start = time.process_time()
    read_gaussians(path)
    assert time.process_time() - start < 1
    tracemalloc.start()
    read_gaussians(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2.5 * path.stat().st_size


def test_normals_that_are_not_whole_are_none(tmp_path):
    data = ply_bytes(random_gaussians(3, 0), tmp_path).replace(b"float nz", b"float no")
    (tmp_path / "a.ply").write_bytes(data)
    assert read_gaussians(tmp_path / "a.ply").normals is None


def test_a_file_leaves_room_on_the_disk(tmp_path, monkeypatch):
    """A file of holes, which takes no room itself, was converted until the disk was full."""
    gaussians = random_gaussians(40, 1)
    size = 40 * (3 + 3 + 9 + 1 + 3 + 4 + 3) * 4
    assert gaussians.nbytes == size
    usage = shutil.disk_usage(tmp_path)
    free = iter([size + SPARE, size + SPARE - 1])
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=next(free)))
    write_gaussians(tmp_path / "a.ply", gaussians)
    with pytest.raises(StorageError, match=r"b\.ply cannot be written, as the disk is full"):
        write_gaussians(tmp_path / "b.ply", gaussians)
    assert [file.name for file in tmp_path.iterdir()] == ["a.ply"]


def test_a_refusal_is_a_whole_sentence(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"ply\n")
    with pytest.raises(GaussianFileError, match=r"a\.ply: .*\.$"):
        read_gaussians(tmp_path / "a.ply")
