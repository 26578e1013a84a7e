import dataclasses
import gzip
import struct
import tracemalloc

import numpy as np
import pytest
import torch

from ico3d.common.spz.container import FREE_BYTES, MAX_RATIO
from ico3d.errors import GaussianFileError
from ico3d.splat import harmonics, quaternions
from ico3d.splat.files.formats import read_file, read_gaussians, write_gaussians
from support.splats.gaussian_files import as_gsply, gsply, random_gaussians, same

FLIP = np.array([1, -1, -1], np.float32)
VALUES = ("means", "dc", "rest", "opacities", "log_scales", "quats")


def sigmoid(values):
    return 1 / (1 + np.exp(-values.astype(np.float64)))


def unit(quats):
    return quats / np.linalg.norm(quats, axis=1, keepdims=True)


def assert_within_quantisation(read, raw, bits=12):
    """Half a step everywhere, where the format's range reaches."""
    slack = 1 + 1e-4
    assert np.abs(read.means - raw.means).max() <= 2.0 ** -(bits + 1) * slack
    assert np.abs(read.log_scales - raw.log_scales.clip(-10, 5.9375)).max() <= slack / 32
    assert np.abs(sigmoid(read.opacities) - sigmoid(raw.opacities)).max() <= slack / 510
    limit = 0.5 / 0.15
    assert np.abs(read.dc - raw.dc.clip(-limit, limit)).max() <= slack / (510 * 0.15)
    assert np.abs(read.rest - raw.rest.clip(-1, 127 / 128)).max(initial=0) <= slack / 256
    expected = unit(raw.quats)
    expected *= np.sign((expected * read.quats).sum(1, keepdims=True))  # q and -q are one rotation
    error = np.abs(read.quats - expected)  # (N, 4)
    largest = np.abs(expected).argmax(1)[:, None]
    half_step = np.sqrt(0.5) / 511 / 2
    np.put_along_axis(error, largest, 0, 1)
    assert error.max() <= half_step * slack
    # The largest follows from length 1: its error is at most Σ|q_i|·step / largest, largest ≥ ½.
    assert np.abs(read.quats - expected).max() <= 2 * np.sqrt(3) * half_step * slack


@pytest.mark.parametrize("degree", range(4))
def test_a_round_trip_errs_by_half_a_step(tmp_path, degree):
    raw = random_gaussians(3000, degree)
    raw.log_scales[:3] = [[-12, 7, 0], [-10, 5.9375, 0.01], [-9.99, 5.9, -0.03]]
    raw.dc[0] = [-9, 9, 0]
    write_gaussians(tmp_path / "a.spz", raw)
    read = read_gaussians(tmp_path / "a.spz")
    assert read.degree == degree
    assert_within_quantisation(read, raw)
    write_gaussians(tmp_path / "b.spz", read)
    again = read_gaussians(tmp_path / "b.spz")  # of equal components, another may be the largest
    assert same(dataclasses.replace(again, quats=read.quats), read)
    assert np.abs((again.quats * read.quats).sum(1)).min() > 1 - 1e-6


def test_far_gaussians_cost_precision_and_too_far_ones_are_refused(tmp_path):
    raw = random_gaussians(10, 0)
    for distance, bits in ((2047.9, 12), (2048, 11), (40000, 7), (8388607, 0)):
        raw.means[3, 1] = distance
        write_gaussians(tmp_path / "a.spz", raw)
        assert_within_quantisation(read_gaussians(tmp_path / "a.spz"), raw, bits)
    raw.means[3, 1] = -8388608
    with pytest.raises(GaussianFileError, match="further than SPZ can say"):
        write_gaussians(tmp_path / "a.spz", raw)


def test_a_gaussian_without_rotation_is_not_turned(tmp_path):
    raw = random_gaussians(2, 0)
    raw.quats[0] = 0
    write_gaussians(tmp_path / "a.spz", raw)
    assert read_gaussians(tmp_path / "a.spz").quats[0].tolist() == [1, 0, 0, 0]


def assert_as_second_library(read, other):
    """Equal to what gsply reads, which leaves the axes as they are in the file."""
    turned = read.half_turn()
    # The component that follows from length 1 is a root, and roots of nearly 0 are not exact.
    assert np.allclose(
        np.abs(turned.quats) * turned.quats, np.abs(other.quats) * other.quats, atol=1e-6
    )
    pairs = {"means": "means", "log_scales": "scales", "dc": "sh0"}
    for ours, theirs in pairs.items():
        assert np.allclose(getattr(turned, ours), getattr(other, theirs), atol=1e-6, rtol=0)
    assert np.allclose(sigmoid(turned.opacities), sigmoid(other.opacities), atol=2e-6, rtol=0)
    if read.degree:
        assert np.allclose(turned.rest, other.shN, atol=1e-6, rtol=0)


@pytest.mark.parametrize("degree", range(4))
def test_a_second_library_reads_what_we_write_and_the_other_way_round(tmp_path, degree):
    raw = random_gaussians(500, degree)
    path = tmp_path / "a.spz"
    write_gaussians(path, raw)
    ours = read_gaussians(path)
    assert_as_second_library(ours, gsply.read_spz(path))
    for version in (3, 4):
        gsply.write_spz(path, as_gsply(raw.half_turn()), version=version)
        assert same(read_gaussians(path), ours)


def version_2(count, degree, seed=0):
    """An unpacked file of version 2, random within each attribute, and its rotation bytes."""
    random = np.random.default_rng(seed)
    parts = [random.integers(0, 256, (count, width), np.uint8) for width in (9, 1, 3, 3)]
    angles = unit(random.normal(size=(count, 4)))
    rotation = np.round(angles[:, 1:] * np.sign(angles[:, :1]) * 127.5 + 127.5).astype(np.uint8)
    rest = random.integers(0, 256, (count, 3 * ((degree + 1) ** 2 - 1)), np.uint8)
    head = struct.pack("<4sIIBBBB", b"NGSP", 2, count, degree, 12, 0, 0)
    return head + b"".join(part.tobytes() for part in (*parts, rotation, rest))


@pytest.mark.parametrize("degree", range(4))
def test_version_2_is_read(tmp_path, degree):
    path = tmp_path / "a.spz"
    path.write_bytes(gzip.compress(version_2(200, degree)))
    assert read_file(path).kind == "SPZ"
    assert_as_second_library(read_gaussians(path), gsply.read_spz(path))


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_colours_and_shapes_are_the_same_from_the_same_side_in_both_frames(tmp_path, degree):
    raw = random_gaussians(60, degree)
    write_gaussians(tmp_path / "a.spz", raw)
    file = gsply.read_spz(tmp_path / "a.spz")  # x right, y up, z backward, as the format says
    stored = torch.tensor(np.concatenate([file.sh0[:, None], file.shN], 1))
    original = torch.tensor(np.concatenate([raw.dc[:, None], raw.rest], 1))
    directions = torch.tensor(np.random.default_rng(1).normal(size=(40, 60, 3)).astype(np.float32))
    here = harmonics.to_colors(original, directions)
    there = harmonics.to_colors(stored, directions * torch.tensor(FLIP))
    wrong = harmonics.to_colors(stored, directions)
    assert (here - there).abs().max() < 0.03
    assert (here - wrong).abs().max() > 0.5
    turned = raw.half_turn()
    exact = harmonics.to_colors(
        torch.tensor(np.concatenate([turned.dc[:, None], turned.rest], 1)),
        directions * torch.tensor(FLIP),
    )
    assert torch.allclose(exact, here, atol=1e-6)


def covariance(gaussians):
    axes = quaternions.to_matrix(gaussians.quats.double()) * gaussians.scales.double()[:, None]
    return axes @ axes.mT


def test_a_half_turn_is_a_rotation_by_180_degrees_about_x_and_its_own_inverse():
    raw = random_gaussians(100, 3)
    turned = raw.half_turn()
    expected = raw.to_gaussians().transform(torch.diag(torch.tensor([1.0, -1, -1, 1])))
    active = turned.to_gaussians()
    assert torch.equal(active.means, expected.means)
    assert torch.allclose(covariance(active), covariance(expected), rtol=1e-5, atol=1e-12)
    assert active.sh is not None and expected.sh is not None
    assert torch.allclose(active.sh, expected.sh, atol=1e-5)
    assert same(turned.half_turn(), raw)


def unpacked(raw, folder):
    write_gaussians(folder / "whole.spz", raw)
    return bytearray(gzip.decompress((folder / "whole.spz").read_bytes()))


@pytest.mark.parametrize(
    "offset, value, says",
    [
        (0, b"X", "does not begin a header 'NGSP'"),
        (4, b"\1", "version 1 at byte 4"),
        (4, b"\4", "version 4 at byte 4 of a gzip stream"),
        (8, b"\x33", "the count at byte 8 is damaged"),
        (8, b"\x31", "data goes on after the last Gaussian, unpacked byte 3201"),
        (9, b"\xff\xff\xff", "more than a file of"),
        (12, b"\4", "SH degree 4 at byte 12"),
        (13, b"\x19", "25 fractional bits at byte 13"),
    ],
)
def test_damaged_headers_are_refused_with_the_byte(tmp_path, offset, value, says):
    data = unpacked(random_gaussians(50, 3), tmp_path)
    data[offset : offset + len(value)] = value
    (tmp_path / "a.spz").write_bytes(gzip.compress(data))
    with pytest.raises(GaussianFileError, match=says):
        read_gaussians(tmp_path / "a.spz")


def test_cut_off_and_altered_streams_are_refused_with_the_byte(tmp_path):
    write_gaussians(tmp_path / "a.spz", random_gaussians(500, 1))
    data = (tmp_path / "a.spz").read_bytes()
    (tmp_path / "a.spz").write_bytes(data[:5000])
    with pytest.raises(GaussianFileError, match="where the file ends, at byte 5000"):
        read_gaussians(tmp_path / "a.spz")
    (tmp_path / "a.spz").write_bytes(data[:-6] + b"\0\0" + data[-4:])  # in the checksum
    with pytest.raises(GaussianFileError, match="damaged before byte"):
        read_gaussians(tmp_path / "a.spz")


def test_announced_extensions_are_passed_over(tmp_path):
    raw = random_gaussians(50, 0)
    data = unpacked(raw, tmp_path)
    data[14] = 2
    (tmp_path / "a.spz").write_bytes(gzip.compress(data + b"extension"))
    assert same(read_gaussians(tmp_path / "a.spz"), read_gaussians(tmp_path / "whole.spz"))


def test_equal_gaussians_pack_well_and_are_still_read(tmp_path):
    raw = random_gaussians(1, 3)
    repeated = {name: np.repeat(getattr(raw, name), 4000, 0) for name in VALUES}
    write_gaussians(tmp_path / "a.spz", type(raw)(**repeated))
    assert len(read_gaussians(tmp_path / "a.spz")) == 4000


def test_bombs_are_refused_before_they_go_off(tmp_path):
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, 1_000_000, 3, 12, 0, 0)
    (tmp_path / "a.spz").write_bytes(gzip.compress(head + bytes(65_000_000)))
    with pytest.raises(GaussianFileError, match=r"1000000 Gaussians, 65000000 bytes unpacked"):
        read_gaussians(tmp_path / "a.spz")
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, 0, 3, 12, 2, 0)
    data = gzip.compress(head + bytes(65_000_000))
    assert MAX_RATIO * len(data) + FREE_BYTES < 1_000_000
    (tmp_path / "a.spz").write_bytes(data)
    tracemalloc.start()
    with pytest.raises(GaussianFileError, match="after unpacked byte 16 follows more"):
        read_gaussians(tmp_path / "a.spz")
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


@pytest.mark.parametrize(
    "offset, value, says",
    [
        (15, b"\7", "7 streams"),
        (16, b"\xff\xff", "listed at byte 65535"),
        (32, b"\xff\xff", "the stream of positions has impossible sizes at byte 32"),
        (40, b"\0", "the stream of positions has impossible sizes at byte 32"),
        (130, b"\xff\xff\xff\xff\xff\xff", "the zstd stream at byte 128 is damaged"),
        (4, b"\3", "version 3 at byte 4 of a file without gzip"),
    ],
)
def test_damaged_files_of_version_4_are_refused_with_the_byte(tmp_path, offset, value, says):
    path = tmp_path / "a.spz"
    gsply.write_spz(path, as_gsply(random_gaussians(50, 3)), version=4)
    data = bytearray(path.read_bytes())
    data[offset : offset + len(value)] = value
    path.write_bytes(data)
    with pytest.raises(GaussianFileError, match=says):
        read_gaussians(path)
