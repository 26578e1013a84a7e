"""Compressed PLY, .splat, what is neither, and `ico3d convert`."""

import numpy as np
import pytest

from ico3d.cli import main
from ico3d.common.unpacking import memory
from ico3d.errors import GaussianFileError, SettingsError
from ico3d.splat.files.formats import read_file, read_gaussians, write_gaussians
from support.splats.gaussian_files import as_gsply, gsply, random_gaussians, same, splat_bytes


def sigmoid(values):
    return 1 / (1 + np.exp(-values.astype(np.float64)))


def rows(gaussians):
    parts = [gaussians.means, gaussians.log_scales, gaussians.quats, gaussians.dc]
    return np.concatenate([*parts, gaussians.rest.reshape(len(gaussians), -1)], 1)


@pytest.mark.parametrize("degree", range(4))
def test_compressed_ply_of_the_second_library(tmp_path, degree):
    path = tmp_path / "a.compressed.ply"
    raw = random_gaussians(1000, degree)  # the last of its four chunks is not full
    gsply.plywrite(str(path), as_gsply(raw), compressed=True)
    read, other = read_file(path), gsply.plyread(path)
    assert read.kind == "compressed PLY" and read.gaussians.degree == degree
    ours = read.gaussians
    assert np.allclose(ours.means, other.means, atol=2e-6)
    assert np.allclose(ours.log_scales, other.scales, atol=2e-6)
    assert np.allclose(ours.quats, other.quats, atol=1e-6)
    assert np.allclose(ours.dc, other.sh0, atol=2e-6)
    assert np.allclose(sigmoid(ours.opacities), sigmoid(other.opacities), atol=1e-4)
    if degree:
        assert np.array_equal(ours.rest, other.shN)


def test_compressed_ply_is_close_to_what_was_compressed(tmp_path):
    path = tmp_path / "a.compressed.ply"
    raw = random_gaussians(256, 3)  # one chunk: its bounds are those of all
    gsply.plywrite(str(path), as_gsply(raw), compressed=True)
    read = read_gaussians(path)
    # The writer sorts: the nearest position is the partner.
    nearest = np.linalg.norm(raw.means[:, None] - read.means, axis=-1).argmin(1)
    assert len(set(nearest)) == 256
    steps = np.array([2047, 1023, 2047])
    for ours, original in ((read.means, raw.means), (read.log_scales, raw.log_scales)):
        step = np.ptp(original, axis=0) / steps
        assert (np.abs(ours[nearest] - original) <= 0.5001 * step + 1e-6).all()
    assert np.abs(read.rest[nearest] - raw.rest).max() <= 1 / 32 + 1e-6
    alignment = (read.quats[nearest] * raw.quats).sum(1) / np.linalg.norm(raw.quats, axis=1)
    assert np.abs(alignment).min() > 1 - 1e-5


@pytest.mark.parametrize(
    "old, new, says",
    [
        (b"element chunk", b"element chunc", "without the element 'chunk'"),
        (b"float max_scale_y", b"float max_skale_y", "lack the property max_scale_y"),
        (b"uint packed_scale", b"float packed_scale", "packed_scale is no 32-bit"),
        (b"uint packed_scale", b"uint packed_sckle", "packed_scale is no 32-bit"),
        (b"uchar f_rest_3\n", b"uchar f_rust_3\n", "the element 'sh' is expected"),
    ],
)
def test_compressed_ply_of_other_layout_is_refused(tmp_path, old, new, says):
    path = tmp_path / "a.compressed.ply"
    gsply.plywrite(str(path), as_gsply(random_gaussians(300, 1)), compressed=True)
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(GaussianFileError, match=says):
        read_gaussians(path)


def test_splat_files_by_name_and_by_contents(tmp_path):
    raw = random_gaussians(300, 0)
    raw.dc[:] = raw.dc.clip(-1.7, 1.7)
    for name in ("a.splat", "b.bin"):
        (tmp_path / name).write_bytes(splat_bytes(raw))
        file = read_file(tmp_path / name)
        assert file.kind == ".splat"
        read = file.gaussians
        assert np.array_equal(read.means, raw.means)
        assert np.allclose(read.log_scales, raw.log_scales, atol=1e-6)
        # Its writer rounds down: a step, not half of one.
        assert np.abs(read.dc - raw.dc).max() <= 1 / 255 / 0.28209 + 1e-5
        assert np.abs(sigmoid(read.opacities) - sigmoid(raw.opacities)).max() <= 1 / 255 + 1e-6
        expected = raw.quats / np.linalg.norm(raw.quats, axis=1, keepdims=True)
        assert np.abs(read.quats - expected).max() <= 1 / 128 + 1e-6


def test_damaged_splat_files_are_refused_with_the_byte(tmp_path):
    data = bytearray(splat_bytes(random_gaussians(5, 0)))
    path = tmp_path / "a.splat"
    path.write_bytes(data[:150])
    with pytest.raises(GaussianFileError, match="150 bytes ends within the Gaussian at byte 128"):
        read_gaussians(path)
    data[64 + 12 : 64 + 16] = np.float32(-1).tobytes()
    path.write_bytes(data)
    with pytest.raises(GaussianFileError, match="Gaussian 2, at byte 64, has a scale below 0"):
        read_gaussians(path)
    data[32:36] = np.float32(np.nan).tobytes()
    data[64 + 12 : 64 + 16] = np.float32(1).tobytes()
    path.write_bytes(data)
    with pytest.raises(GaussianFileError, match="Gaussian 1 has the x nan"):
        read_gaussians(path)
    path.write_bytes(b"")
    with pytest.raises(GaussianFileError, match="without a byte"):
        read_gaussians(path)


@pytest.mark.parametrize("data", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n" + bytes(88), bytes(64)])
def test_other_files_are_refused_in_one_sentence(tmp_path, data):
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(GaussianFileError, match=r"a\.ply: no 3D Gaussians .* at byte 0"):
        read_gaussians(tmp_path / "a.ply")


def test_a_file_that_takes_more_than_the_memory_is_refused(tmp_path, monkeypatch):
    """A hole of a file: a disk holds it in no bytes."""
    path = tmp_path / "a.splat"
    with path.open("wb") as file:
        file.truncate(3200)
    monkeypatch.setattr(memory, "free_memory", lambda: 8 * 3200 - 1)
    with pytest.raises(GaussianFileError, match="the free memory is enough for"):
        read_file(path)


@pytest.mark.parametrize(
    "kind, order, times",
    [
        ("float", "binary_little_endian", 8),
        ("uchar", "binary_little_endian", 32),
        ("ushort", "binary_big_endian", 16),
        ("double", "binary_little_endian", 8),
        ("float", "ascii", 24),
    ],
)
def test_room_is_asked_for_by_what_numbers_become(tmp_path, monkeypatch, kind, order, times):
    """Numbers of one byte took fifteen times the file where eight were counted."""
    names = "x y z rot_0 rot_1 rot_2 rot_3 scale_0 scale_1 scale_2 opacity f_dc_0 f_dc_1 f_dc_2"
    head = f"ply\nformat {order} 1.0\nelement vertex 1000\n"
    head += "".join(f"property {kind} {name}\n" for name in names.split()) + "end_header\n"
    path = tmp_path / "a.ply"
    path.write_bytes(head.encode())
    with path.open("r+b") as file:
        file.truncate(80_000)
    monkeypatch.setattr(memory, "free_memory", lambda: times * 80_000 - 1)
    with pytest.raises(GaussianFileError, match="the free memory is enough for"):
        read_file(path)
    monkeypatch.setattr(memory, "free_memory", lambda: times * 80_000)
    with pytest.raises(GaussianFileError) as refused:  # damaged, which is found when it is read
        read_file(path)
    assert "free memory" not in str(refused.value)


def test_missing_files_folders_and_unknown_names_are_refused(tmp_path):
    with pytest.raises(GaussianFileError, match="cannot be read"):
        read_gaussians(tmp_path / "none.ply")
    with pytest.raises(GaussianFileError, match="cannot be read"):
        read_gaussians(tmp_path)
    with pytest.raises(SettingsError, match=r"named \.ply or \.spz"):
        write_gaussians(tmp_path / "a.splat", random_gaussians(1, 0))
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(GaussianFileError, match="cannot be written"):
        write_gaussians(tmp_path / "file" / "a.ply", random_gaussians(1, 0))


def test_contents_count_not_names(tmp_path):
    raw = random_gaussians(20, 1)
    write_gaussians(tmp_path / "a.spz", raw)
    write_gaussians(tmp_path / "a.ply", raw)
    (tmp_path / "a.spz").rename(tmp_path / "b.ply")
    (tmp_path / "a.ply").rename(tmp_path / "b.spz")
    assert [read_file(tmp_path / f"b.{s}").kind for s in ("ply", "spz")] == ["SPZ", "PLY"]


def test_convert_says_what_it_read_and_wrote(tmp_path, capsys):
    raw = random_gaussians(1500, 3)
    source, target = tmp_path / "a.ply", tmp_path / "b.spz"
    write_gaussians(source, raw)
    assert main(["convert", str(source), str(target), "--sh-degree", "1"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"{source}: PLY, 1,500 Gaussians, SH degree 3, {source.stat().st_size:,} bytes"
    assert second == f"{target}: SPZ, 1,500 Gaussians, SH degree 1, {target.stat().st_size:,} bytes"
    read = read_gaussians(target)
    assert np.abs(rows(read)[:, :3] - raw.means).max() <= 2**-13
    assert np.abs(read.rest - raw.rest[:, :3]).max() <= 1 / 256 + 1e-6
    assert main(["convert", str(target), str(tmp_path / "c.ply")]) == 0
    assert same(read_gaussians(tmp_path / "c.ply").half_turn().half_turn(), _with_zeros(read))


def _with_zeros(raw):
    return type(raw)(**{**vars(raw), "normals": np.zeros((len(raw), 3), np.float32)})


def test_convert_refuses_in_one_sentence_and_leaves_the_target_alone(tmp_path, capsys):
    write_gaussians(tmp_path / "a.ply", random_gaussians(10, 0))
    target = tmp_path / "b.ply"
    target.write_bytes(b"precious")
    assert main(["convert", str(tmp_path / "a.ply"), str(target), "--sh-degree", "2"]) == 1
    assert "have 0 only" in capsys.readouterr().err
    (tmp_path / "a.ply").write_bytes(b"ply\nrubbish")
    assert main(["convert", str(tmp_path / "a.ply"), str(target)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert target.read_bytes() == b"precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.ply", "b.ply"]
