"""The baked body: its file, its evaluation, and what is refused."""

import json
import struct
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Manifest
from ico3d.bundle.windows.baked import BakedWindow, _continued, _largest
from ico3d.errors import BundleError
from support.bundles.json_values import json_values
from support.bundles.random_body import (
    RANKS,
    body_manifest,
    random_window,
    random_windows,
    write_random_body,
)
from support.bundles.random_bundle import random_head, random_manifest

RELAXED = settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
WINDOWS = random_windows()
MANIFEST = body_manifest(WINDOWS)
BODY = MANIFEST.body
assert BODY is not None
NAME = BODY.windows[0].file
DATA = WINDOWS[0].to_bytes(NAME)
VALID = json.loads(MANIFEST.to_json())


@pytest.fixture(scope="module")
def body_bytes(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("body") / "valid.ico3d"
    write_random_body(path)
    return path.read_bytes()


def read(data: bytes) -> BakedWindow:
    assert BODY is not None
    return BakedWindow.from_bytes(data, BODY, BODY.windows[0])


def loop_evaluation(window: BakedWindow, tau: float) -> list[np.ndarray]:
    """Slowly, from the format's description alone."""
    rows = window.coefficients.astype(np.float64)
    before = 3 * rows[0] - 3 * rows[1] + rows[2]
    after = 3 * rows[-1] - 3 * rows[-2] + rows[-3]
    rows = [before, *rows, after]
    place = tau * (len(rows) - 3)
    i = min(int(place), len(rows) - 4)
    p0, p1, p2, p3 = rows[i : i + 4]
    x = place - i
    m1, m2 = (p2 - p0) / 2, (p3 - p1) / 2  # slopes of the Hermite form
    c = (2 * x**3 - 3 * x**2 + 1) * p1 + (x**3 - 2 * x**2 + x) * m1
    c += (3 * x**2 - 2 * x**3) * p2 + (x**3 - x**2) * m2
    means, quats, scales = [], [], []
    for n in range(window.num_gaussians):
        mean, quat = window.means[n].astype(float), window.quats[n] / 32767
        scale = window.scales[n].astype(float)
        own = c[window.clusters[n]]
        for k in range(5):
            mean = mean + own[k] * window.position_basis[k, n]
        for k in range(3):
            quat = quat + own[5 + k] * window.rotation_basis[k, n]
        for k in range(2):
            scale = scale + own[8 + k] * window.scale_basis[k, n]
        means.append(mean)
        quats.append(quat / np.linalg.norm(quat))
        scales.append(np.maximum(scale, 1e-6))
    return [np.array(means), np.array(quats), np.array(scales)]


@pytest.mark.parametrize("tau", [0.0, 0.03, 0.125, 0.4, 0.77, 0.99, 1.0])
def test_the_evaluator_does_what_the_format_says(tau):
    for ours, truth in zip(WINDOWS[0].at(tau), loop_evaluation(WINDOWS[0], tau), strict=True):
        assert ours.dtype == np.float32
        np.testing.assert_allclose(ours, truth, rtol=2e-5, atol=2e-6)


def test_coefficients_go_through_their_samples_and_are_exact_on_parabolas():
    window = random_window(3, RANKS, 9, clusters=1)
    for i, row in enumerate(window.coefficients):
        np.testing.assert_allclose(window.coefficients_at(i / 8), row, rtol=1e-5)
    taus = np.linspace(0, 1, 9, dtype=np.float32)
    parabola = (1 - 2 * taus + 3 * taus**2)[:, None, None] * np.arange(1, 11, dtype=np.float32)
    curved = replace(window, coefficients=parabola)
    for tau in (0.01, 0.2, 0.33, 0.9):
        expected = (1 - 2 * tau + 3 * tau**2) * np.arange(1, 11)
        np.testing.assert_allclose(curved.coefficients_at(tau)[0], expected, rtol=1e-5)


@given(st.floats(0, 1), st.integers(3, 12))
def test_motion_is_continuous(tau, samples):
    window = random_window(2, RANKS, samples, seed=samples)
    step = 1e-4
    a, b = window.coefficients_at(tau), window.coefficients_at(min(tau + step, 1))
    steepest = 8 * np.abs(window.coefficients).max() * samples
    assert np.abs(a - b).max() <= steepest * step


def test_a_window_reads_back_as_it_was_written():
    back = read(DATA)
    for name, tensor in vars(WINDOWS[0]).items():
        np.testing.assert_array_equal(getattr(back, name), tensor)
        assert getattr(back, name).dtype == tensor.dtype


def test_it_takes_97_bytes_per_gaussian_and_the_curves():
    window = random_window(7000, (5, 3, 2), 27, clusters=32)
    curves = 4 * 27 * 32 * 10 / 7000
    assert 97 + curves <= len(window.to_bytes("w")) / 7000 < 97.2 + curves


def test_a_bundle_of_a_body_alone_reads_back(tmp_path):
    manifest = write_random_body(tmp_path / "a.ico3d")
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.manifest == manifest and bundle.head is None and bundle.world_from_head is None
    for i, window in enumerate(WINDOWS):
        np.testing.assert_array_equal(bundle.window(i).rgba, window.rgba)
    with pytest.raises(BundleError, match="no window 2"):
        bundle.window(2)
    with pytest.raises(BundleError, match="a body only, no head"):
        bundle.require_head()


def test_bundles_from_before_bodies_are_read():
    manifest = random_manifest(random_head(10))
    older = json.loads(manifest.to_json())
    older["version"] = 1
    del older["body"]
    assert Manifest.from_json(json.dumps(older).encode()) == manifest


def with_header(change) -> bytes:
    (length,) = struct.unpack_from("<Q", DATA)
    header = json.loads(DATA[8 : 8 + length])
    change(header)
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + DATA[8 + length :]


def spoiled(name: str, value) -> bytes:
    tensor = getattr(WINDOWS[0], name).copy()
    tensor.flat[5] = value
    tensors = vars(WINDOWS[0]) | {name: tensor}
    from safetensors.numpy import save

    return save({key: np.ascontiguousarray(array) for key, array in tensors.items()})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (with_header(lambda h: h.pop("rgba")), "lacks tensor 'rgba'"),
        (with_header(lambda h: h.update(more=h["rgba"])), "unknown tensor 'more'"),
        (with_header(lambda h: h["quats"].update(dtype="F16")), "'quats' must be I16"),
        (with_header(lambda h: h["rgba"].update(dtype="I8")), "'rgba' must be U8"),
        (with_header(lambda h: h["means"].update(shape=[10**12, 3])), "'means' must be F32"),
        (with_header(lambda h: h["means"].update(data_offsets=[0, 10**15])), "must take"),
        (random_window(21, RANKS, 9).to_bytes(NAME), "must be"),
        (random_window(20, (4, 3, 2), 9).to_bytes(NAME), "'position_basis' must be"),
        (random_window(20, RANKS, 8).to_bytes(NAME), "'coefficients' must be"),
        (random_window(20, RANKS, 9, clusters=2).to_bytes(NAME), "'coefficients' must be"),
        (spoiled("clusters", 3), "'clusters' names one that is not there"),
        (spoiled("means", np.nan), "'means' holds a value that is not finite"),
        (spoiled("means", 1e9), "reaches farther"),
        (spoiled("scales", np.inf), "'scales' holds a value that is not finite"),
        (spoiled("scales", 60000.0), "grow beyond"),
        (spoiled("coefficients", np.nan), "'coefficients' holds"),
        (spoiled("coefficients", 1e30), "reaches farther|out of range|grow beyond"),
        (DATA[:-1], "outside|must take"),
        (DATA + b"x", "belong to no tensor"),
        (b"", "too short"),
    ],
)
def test_a_hostile_window_is_refused_in_one_sentence(data, message):
    with pytest.raises(BundleError, match=message) as caught:
        read(data)
    assert str(caught.value).startswith(NAME) and "\n" not in str(caught.value)


@RELAXED
@given(st.data())
def test_a_damaged_window_is_refused_or_finite(data):
    """Without its hash: whatever passes the checks can be drawn."""
    damaged = bytearray(DATA)
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        window = read(bytes(damaged))
    except BundleError:
        return
    for tau in (0.0, 0.31, 1.0):
        assert all(np.isfinite(values).all() for values in window.at(tau))


@RELAXED
@given(st.data())
def test_flipped_bytes_never_pass_as_another_body(body_bytes, tmp_path, data):
    damaged = bytearray(body_bytes)
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "bad.ico3d"
    path.write_bytes(damaged)
    try:
        bundle = Bundle.open(path)
    except BundleError:
        return
    np.testing.assert_array_equal(bundle.window(1).means, WINDOWS[1].means)


@pytest.mark.parametrize("clusters", [174, 175])
def test_curves_are_bounded(clusters):
    """A file of a few MB, packed, would be hundreds on a page."""
    window = replace(BODY.windows[0], last=1000, num_clusters=clusters, ranks=(1, 1, 1))
    told = replace(MANIFEST, body=replace(BODY, samples_per_frame=8, windows=(window,))).to_json()
    if clusters == 174:
        assert Manifest.from_json(told).body.windows == (window,)
        return
    with pytest.raises(BundleError, match=r"num_clusters must be less: times .* not 4200525\."):
        Manifest.from_json(told)


def changed(path: str, value) -> bytes:
    manifest = json.loads(json.dumps(VALID))
    place = manifest
    *parents, last = path.split(".")
    for key in parents:
        place = place[int(key) if key.isdigit() else key]
    place[last] = value
    return json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("body", None, "head must be there where no body is"),
        ("body.fps", 0, "body.fps"),
        ("body.samples_per_frame", 0, "samples_per_frame"),
        ("body.samples_per_frame", 9, "samples_per_frame"),
        ("body.low", [3, 3, 3], "body.low"),
        ("body.low", [0, 0], "3 entries"),
        ("body.windows", [], "body.windows"),
        ("body.windows.0.num_gaussians", 0, "num_gaussians"),
        ("body.windows.0.num_gaussians", 10**9, "num_gaussians"),
        ("body.windows.0.num_clusters", 0, "num_clusters"),
        ("body.windows.0.num_clusters", 257, "num_clusters"),
        ("body.windows.0.ranks", [5, 3], "3 entries"),
        ("body.windows.0.ranks", [5, 0, 2], "ranks"),
        ("body.windows.0.ranks", [17, 3, 2], "ranks"),
        (
            "body.windows.0.num_gaussians",
            10**6,
            r"body.windows must be less: .* not 11000000\.",
        ),
        ("body.windows.0.first", 1, r"windows\[0\].first must be 0"),
        ("body.windows.1.first", 5, r"windows\[1\].first must be 4"),
        ("body.windows.1.last", 4, r"windows\[1\].last"),
        ("body.windows.1.last", 10**7, r"windows\[1\].last"),
        ("body.windows.1.file", "body/0000.safetensors", r"windows\[1\].file"),
        ("body.windows.1.file", "../evil", r"windows\[1\].file"),
        ("body.windows.1.more", 1, "unknown key 'more'"),
        ("speech", {"encoder": "", "sha256": "", "fps": 25, "input": "mel"}, "speech"),
        ("version", 8, "versions 1 to 7"),
    ],
)
def test_a_wrong_field_is_named(path, value, message):
    with pytest.raises(BundleError, match=message):
        Manifest.from_json(changed(path, value))


paths = st.sampled_from(
    [f"body.{key}" for key in VALID["body"]]
    + [f"body.windows.1.{key}" for key in VALID["body"]["windows"][1]]
)


@given(paths, json_values)
def test_any_value_anywhere_is_read_or_refused(path, value):
    try:
        Manifest.from_json(changed(path, value))
    except BundleError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("name", ["body/0000.safetensors", "body/0001.safetensors"])
def test_a_missing_window_is_named(body_bytes, tmp_path, name):
    path, folder = tmp_path / "a.ico3d", tmp_path / "folder"
    path.write_bytes(body_bytes)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    (folder / name).unlink()
    with pytest.raises(BundleError, match=name):
        Bundle.open(folder)


@pytest.mark.parametrize("samples", [3, 4, 40])
def test_the_largest_coefficients_are_those_of_all_samples_continued(samples):
    rows = np.random.default_rng(samples).normal(size=(samples, 5, 7)).astype(np.float32)
    expected = np.abs(_continued(rows.astype(np.float64))).max(axis=0)
    np.testing.assert_allclose(_largest(rows), expected, rtol=1e-7)
