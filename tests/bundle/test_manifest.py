"""The manifest's own checks."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.bundle.manifest import Manifest
from ico3d.errors import BundleError
from support.bundles.json_values import json_values
from support.bundles.random_bundle import random_head, random_manifest

VALID = json.loads(random_manifest(random_head(10)).to_json())


def changed(path: str, value) -> bytes:
    manifest = json.loads(json.dumps(VALID))
    place = manifest
    *parents, last = path.split(".")
    for key in parents:
        place = place[key]
    place[last] = value
    return json.dumps(manifest).encode()


def test_round_trip():
    manifest = random_manifest(random_head(10))
    assert Manifest.from_json(manifest.to_json()) == manifest


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("format", "glb", "no ico3d bundle"),
        ("version", 8, "versions 1 to 7"),
        ("head.num_gaussians", 0, "num_gaussians"),
        ("head.num_gaussians", 10**9, "num_gaussians"),
        ("head.num_gaussians", 4.5, "a whole number"),
        ("head.num_gaussians", True, "a whole number"),
        ("head.rank", 300, "rank"),
        ("head.num_gaussians", 999_999, "head.rank must be less: Gaussians"),
        ("head.num_displacements", 17, "num_displacements must lie between 0 and 16"),
        ("head.num_displacements", -1, "num_displacements"),
        ("head.gaze", {"eyes": [0, 0, 0.06], "most": [0.2, 0.6]}, "head.gaze.most must lie"),
        ("head.gaze", {"eyes": [0, 0, 0.06], "most": [0, 0.1]}, "head.gaze.most must lie"),
        ("head.gaze", {"eyes": [0, 2, 0], "most": [0.2, 0.1]}, "head.gaze.eyes must lie"),
        ("head.gaze", {"eyes": [0, 0], "most": [0.2, 0.1]}, "head.gaze.eyes must have 3"),
        ("head.inputs", "video", "inputs"),
        ("head.idle_expression", [0.0], "idle_expression"),
        ("head.idle_expression", ["a"] * 39, "a number"),
        ("head.expression_names", ["a"], "expression_names"),
        ("head.eye_offset", 33, "eye_offset"),
        ("head.fps", 0, "fps"),
        ("speech", None, "speech"),
        ("speech.input", "text", "speech.input"),
        ("speech.encoder", "/proc/self/cwd/enc", "speech.encoder"),
        ("speech.encoder", "../enc", "speech.encoder"),
        ("speech.encoder", "", "speech.encoder"),
        ("speech.sha256", "/../" + "0" * 60, "speech.sha256"),
        ("speech.sha256", "0" * 63, "speech.sha256"),
        ("camera.fov_y", 200, "fov_y"),
        ("camera.eye", [0, 0], "3 entries"),
        ("camera.eye", [0, 0, 0], "camera.eye"),
        ("camera.eye", [0, 0, 1e308], "camera.eye must be within 10000 m"),
        ("camera.eye", [0, 0, 1e-320], "an eye away from its target"),
        ("camera.eye", [0, 2, 0], "camera.up must point another way"),
        ("background", [0, 0, 2], "background"),
        ("name", "a" + "\u0301" * 100, "name must have at most 100 letters"),
        ("provenance.likeness", "a" * 2001, "provenance must have at most"),
        ("provenance.sources", ["a" * 1900] * 6, "10000 in all"),
        ("provenance.sources", ["a"] * 1001, "provenance must have at most"),
        ("persona", [], "an object"),
        ("persona.notes", "hello", "a list"),
        ("extra", 1, "unknown key 'extra'"),
        ("files", {"a": {"sha256": "xyz", "size": 1}}, "sha256"),
        ("files", {"a": {"sha256": "0" * 64, "size": -1}}, "size"),
        ("files", {"a": {"sha256": "0" * 64, "size": 1 << 40}}, "size"),
    ],
)
def test_a_wrong_field_is_named(path, value, message):
    with pytest.raises(BundleError, match=message):
        Manifest.from_json(changed(path, value))


def test_a_number_of_endless_digits_is_refused():
    data = changed("head.num_gaussians", 77777).replace(b"77777", b"7" * 100_000)
    with pytest.raises(BundleError, match=r"manifest\.json"):
        Manifest.from_json(data)


def test_a_missing_field_is_named():
    manifest = {key: value for key, value in VALID.items() if key != "camera"}
    with pytest.raises(BundleError, match="lacks 'camera'"):
        Manifest.from_json(json.dumps(manifest).encode())


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff\xfe", b"[" * 100_000, b'{"a": NaN}', b'{"a": 1, "a": 2}', b"[]", b"1e999"],
    ids=["empty", "no UTF-8", "deep", "NaN", "twice", "list", "infinite"],
)
def test_bad_json_is_refused(data):
    with pytest.raises(BundleError, match=r"manifest\.json"):
        Manifest.from_json(data)


def test_an_infinite_number_is_refused():
    data = changed("camera.fov_y", 12345.0).replace(b"12345.0", b"1e999")
    with pytest.raises(BundleError, match="finite"):
        Manifest.from_json(data)


paths = st.sampled_from(
    [*VALID, *(f"{a}.{b}" for a in VALID if isinstance(VALID[a], dict) for b in VALID[a])]
)


@given(paths, json_values)
def test_any_value_anywhere_is_read_or_refused(path, value):
    try:
        Manifest.from_json(changed(path, value))
    except BundleError as error:
        assert "\n" not in str(error)
