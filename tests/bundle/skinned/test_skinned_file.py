"""The file of a body on a skeleton, and what the manifest says about it."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

from ico3d.bundle.format import Bundle, write_bundle
from ico3d.bundle.manifest import VERSION, Manifest
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import GESTURES, gesture_files, gestures_from
from ico3d.bundle.skinned.info import SKINNED
from ico3d.bundle.skinned.packing import packed_quats
from ico3d.bundle.skinned.posing import any_pose, posed, recorded_pose
from ico3d.errors import BundleError
from ico3d.motion.gestures.library import library
from ico3d.motion.gestures.scripts import SCRIPTS
from ico3d.motion.living import living
from ico3d.motion.person import person_of
from ico3d.motion.repertoire import repertoire_bytes
from support.bundles.json_values import json_values
from support.bundles.random_body import body_manifest, random_windows
from support.bundles.random_bundle import thumbnail
from support.bundles.random_skinned import random_skinned, skinned_manifest, write_random_skinned
from support.recorded import body_of, made_still
from support.rigs import rig_of

pytestmark = pytest.mark.slow

RELAXED = settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
BAKED = random_skinned()
DATA = BAKED.to_bytes()
VALID = json.loads(skinned_manifest(BAKED).to_json())


def spoiled(name: str, value, at: int = 5) -> bytes:
    tensors = {key: np.ascontiguousarray(array) for key, array in BAKED.tensors.items()}
    tensors[name] = tensors[name].copy()
    tensors[name].flat[at] = value
    return save(tensors)


def without(name: str) -> bytes:
    return save({key: array for key, array in BAKED.tensors.items() if key != name})


def test_a_bundle_reads_back_as_it_was_written(tmp_path):
    manifest = write_random_skinned(tmp_path / "a.ico3d")
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.manifest == manifest and manifest.version == VERSION
    assert bundle.skinned is not None and bundle.skinned.info == BAKED.info
    for name, tensor in BAKED.tensors.items():
        found = bundle.skinned.tensors[name]
        np.testing.assert_array_equal(found, tensor)
        assert found.dtype == tensor.dtype
    with pytest.raises(BundleError, match="no window 0"):
        bundle.window(0)


def test_sixty_thousand_gaussians_are_under_seven_megabytes():
    """With a minute of motion at 15 frames per second, on the largest number of shapes."""
    baked = random_skinned(60_000, shapes=8, frames=900)
    size = len(baked.to_bytes())
    assert size < 7e6
    assert size - 60_000 * 96 < 900 * (4 * 8 + 12 + 4 * 8) + 10_000  # 96 bytes per Gaussian


def test_bodies_of_windows_are_read_as_before():
    """A manifest of version 2 knows no skeletons."""
    manifest = body_manifest(random_windows())
    older = json.loads(manifest.to_json())
    older["version"] = 2
    del older["skinned"]
    assert Manifest.from_json(json.dumps(older).encode()) == manifest
    older["version"] = 3
    with pytest.raises(BundleError, match="lacks 'skinned'"):
        Manifest.from_json(json.dumps(older).encode())


def test_bodies_without_a_lamp_are_read_as_before(tmp_path):
    """A manifest of version 3 knows no spheres, and its file has no lamp."""
    bare = replace(BAKED, info=replace(BAKED.info, num_casters=0), lamp=None)
    older = json.loads(skinned_manifest(bare).to_json())
    older["version"] = 3
    del older["skinned"]["num_casters"]
    manifest = Manifest.from_json(json.dumps(older).encode())
    assert manifest.skinned == bare.info and BAKED.lamp is not None
    read = BakedSkinned.from_bytes(bare.to_bytes(), bare.info)
    assert read.lamp is None and set(read.tensors) == set(BAKED.tensors) - set(BAKED.lamp.tensors)
    pose = recorded_pose(read, 2.0)
    assert (posed(BAKED, pose).rgb >= posed(read, pose).rgb).all()
    older["version"] = VERSION
    with pytest.raises(BundleError, match="lacks 'num_casters'"):
        Manifest.from_json(json.dumps(older).encode())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (without("rotations"), "lacks tensor 'rotations'"),
        (spoiled("joints", 5), "'joints' names one that is not there"),
        (spoiled("weights", 255), "'weights' must sum to 255"),
        (spoiled("moving", 5, 3), "'moving' must name joints in order"),
        (spoiled("moving", 1, 0), "'moving' must name joints in order"),
        (spoiled("known", 6, 3), "'known' must name frames in order"),
        (spoiled("known", -1, 0), "'known' must name frames in order"),
        (spoiled("rotations", 32767, 4 * 4 + 2), "'rotations' holds one that is no rotation"),
        (spoiled("rotations", 0, 4), "'rotations' holds one that is no rotation"),
        (spoiled("held", -32768), "'held' holds one that is no rotation"),
        (spoiled("quats", 32767, np.abs(BAKED.quats[0]).argmin()), "'quats' holds one"),
        (spoiled("means", np.nan), "'means' holds a value that is not finite"),
        (spoiled("means", 1e9), "'means' is out of range"),
        (spoiled("roots", -1e9), "'roots' is out of range"),
        (spoiled("roots", np.inf), "'roots' holds a value that is not finite"),
        (spoiled("log_scales", 60000.0), "exceeds exp"),
        (spoiled("log_scales", np.nan), "'log_scales' holds"),
        (spoiled("color_logits", 60000.0), "'color_logits' is out of range"),
        (spoiled("light", 1e30), "'light' is out of range"),
        (spoiled("coefficients", 1e30), "'coefficients' is out of range"),
        (spoiled("coefficients", 9e3), "residual shapes are out of range"),
        (spoiled("coefficients", np.nan), "'coefficients' holds"),
        (spoiled("shape_scales", 60000.0), "residual shapes are out of range"),
        (spoiled("kernel_width", 0.0, 0), "'kernel_width' must be more than 0"),
        (spoiled("rig_joints", 1e3), "a joint of the rig lies more than 10 m"),
        (without("caster_points"), "lacks tensor 'caster_points'"),
        (spoiled("lamp_direction", 3.0, 0), "'lamp_direction' is not of length 1"),
        (spoiled("lamp_direction", np.nan, 0), "'lamp_direction' holds a value that is not finite"),
        (spoiled("lamp_strength", -0.1, 0), "'lamp_strength' must lie between 0 and 10000"),
        (spoiled("lamp_strength", 1e9, 2), "'lamp_strength' must lie between 0 and 10000"),
        (spoiled("caster_joints", 5), "'caster_joints' names one that is not there"),
        (spoiled("caster_weights", 255), "'caster_weights' must sum to 255"),
        (random_skinned(21).to_bytes(), "must be"),
        (random_skinned(shapes=4).to_bytes(), "'shapes' must be"),
        (random_skinned(frames=7).to_bytes(), "'rotations' must be"),
        (DATA[:-1], "outside|must take"),
        (DATA + b"x", "belong to no tensor"),
        (b"", "too short"),
    ],
)
def test_a_hostile_body_is_refused_in_one_sentence(data, message):
    with pytest.raises(BundleError, match=message) as caught:
        BakedSkinned.from_bytes(data, BAKED.info)
    assert str(caught.value).startswith(SKINNED) and "\n" not in str(caught.value)


@RELAXED
@given(st.data())
def test_a_damaged_body_is_refused_or_finite(data):
    """Without its hash: whatever passes the checks can be drawn in any pose."""
    damaged = bytearray(DATA)
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        baked = BakedSkinned.from_bytes(bytes(damaged), BAKED.info)
    except BundleError:
        return
    away = np.random.default_rng(0).normal(size=(5, 4))
    for pose in (recorded_pose(baked, 2.3), any_pose(baked, away, np.ones(3))):
        drawn = posed(baked, pose)
        assert all(np.isfinite(values).all() for values in vars(drawn).values())


def changed(path: str, value) -> bytes:
    manifest = json.loads(json.dumps(VALID))
    place = manifest
    *parents, last = path.split(".")
    for key in parents:
        place = place[int(key) if key.isdigit() else key]
    place[int(last) if last.isdigit() else last] = value
    return json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("skinned", None, "head must be there where no body is"),
        ("body", json.loads(body_manifest(random_windows()).to_json())["body"], "skinned must be"),
        ("skinned.fps", 0, "skinned.fps"),
        ("skinned.num_frames", 1, "num_frames"),
        ("skinned.num_frames", 10**6, "num_frames"),
        ("skinned.num_gaussians", 0, "num_gaussians"),
        ("skinned.num_gaussians", 10**9, "num_gaussians"),
        ("skinned.num_shapes", 0, "num_shapes"),
        ("skinned.num_shapes", 9, "num_shapes"),
        ("skinned.num_moving", 6, "num_moving"),
        ("skinned.num_known", 7, "num_known"),
        ("skinned.names", [], "num_moving"),
        ("skinned.names.1", "root", "different names"),
        ("skinned.names.1", "x" * 65, "skinned.names"),
        ("skinned.names.1", 3, "a text"),
        ("skinned.parents", [-1], "differ in number"),
        ("skinned.parents.0", 0, "joint 0 of a rig is its root"),
        ("skinned.parents.2", 2, "parents of a rig come before children"),
        ("skinned.parents.2", -1, "parents of a rig come before children"),
        ("skinned.low", [3, 3, 3], "skinned.low"),
        ("skinned.more", 1, "unknown key 'more'"),
    ],
)
def test_a_wrong_field_is_named(path, value, message):
    with pytest.raises(BundleError, match=message):
        Manifest.from_json(changed(path, value))


fields = st.sampled_from([f"skinned.{key}" for key in VALID["skinned"]] + ["skinned.parents.3"])


@given(fields, json_values)
def test_any_value_anywhere_is_read_or_refused(path, value):
    try:
        Manifest.from_json(changed(path, value))
    except BundleError as error:
        assert "\n" not in str(error)


def test_a_missing_file_is_named(tmp_path):
    manifest = skinned_manifest(BAKED)
    with pytest.raises(BundleError, match=SKINNED):
        write_bundle(tmp_path / "a.ico3d", manifest, {"thumbnail.png": b""})
    with pytest.raises(BundleError, match="does not belong"):
        windows = replace(body_manifest(random_windows()), files={})
        names = {w.file: b"" for w in windows.body.windows} if windows.body else {}
        write_bundle(tmp_path / "a.ico3d", windows, names | {"thumbnail.png": b"", SKINNED: DATA})


def test_gestures_belong_to_the_rig(tmp_path):
    rig = rig_of("SMPL-X", 0.0)
    joints = rig.joints.astype(np.float32)
    info = replace(BAKED.info, names=rig.names, parents=rig.parents)
    held = np.tile(packed_quats(np.array([[1.0, 0, 0, 0]])), (len(rig), 1))
    baked = replace(BAKED, info=info, rig_joints=joints, held=held)
    somebody = living(baked.rig, 0)
    data = repertoire_bytes(somebody, library(somebody.person, ("nod",)))
    files = {SKINNED: baked.to_bytes(), "thumbnail.png": thumbnail(), GESTURES: data}
    write_bundle(tmp_path / "a.ico3d", skinned_manifest(baked), files)
    gestures = Bundle.open(tmp_path / "a.ico3d").gestures
    assert gestures is not None and list(gestures) == ["nod"]
    other = replace(baked, rig_joints=1.1 * joints)
    write_bundle(tmp_path / "b.ico3d", skinned_manifest(other), files | {SKINNED: other.to_bytes()})
    with pytest.raises(BundleError, match="made for another rig"):
        Bundle.open(tmp_path / "b.ico3d")
    with pytest.raises(BundleError, match="does not belong"):
        windows = body_manifest(random_windows())
        assert windows.body is not None
        of_windows = {window.file: b"" for window in windows.body.windows}
        of_windows |= {name: files[name] for name in ("thumbnail.png", GESTURES)}
        write_bundle(tmp_path / "c.ico3d", windows, of_windows)


def test_a_rig_without_roles_has_no_gestures():
    assert gesture_files(BAKED) == {}


def test_what_was_recorded_travels_with_its_cuts(tmp_path, monkeypatch):
    rig = rig_of("SMPL-X", 0.0)
    person = person_of(rig)
    wave = library(person, ("wave",))["wave"].mirrored()
    rotations = made_still(person, wave, 15.0)
    baked = body_of(rig, 15.0, rotations, np.zeros((len(rotations), 3)), 30)
    files = {SKINNED: baked.to_bytes(), "thumbnail.png": thumbnail(), **gesture_files(baked)}
    write_bundle(tmp_path / "a.ico3d", skinned_manifest(baked), files)
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.gestures is not None and set(bundle.gestures) == set(SCRIPTS)
    assert "left_wrist" in bundle.gestures["wave"].curves  # the package waves with the right hand
    found = {cut.name: cut for cut in bundle.cuts}
    assert set(found) == {"rest", "wave"} and found["wave"].hands == "left"
    bow = [replace(found["wave"], name="bow")]
    some = partial(library, names=("nod", "wave"))
    monkeypatch.setattr("ico3d.bundle.skinned.gestures.library", some)
    named = gestures_from(gesture_files(baked, bow)[GESTURES], baked)
    assert set(named.clips) == {"nod", "wave", "bow"} and named.cuts == tuple(bow)
    assert "right_wrist" in named.clips["wave"].curves
    longer = replace(baked, info=replace(baked.info, num_frames=99))
    with pytest.raises(BundleError, match="the list of clips is of a recording of"):
        gestures_from(files[GESTURES], longer)
