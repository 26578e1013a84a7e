"""Whole synthetic people: bones, gestures, cameras all around, and what is written."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError, SettingsError
from ico3d.studio.acting.acting import pose
from ico3d.studio.acting.gestures import act
from ico3d.studio.acting.limbs import reach, split_twist
from ico3d.studio.choice import load_subject
from ico3d.studio.person import bends
from ico3d.studio.person.npz_person import load_npz
from ico3d.studio.person.skeleton import about
from ico3d.studio.person.subject import Material
from ico3d.studio.picture import paint
from ico3d.studio.recording import Recording, record
from ico3d.studio.rigs import cameras_of
from support.recordings import synthetic_bodies, synthetic_people
from support.shared import SUBJECTS

pytestmark = pytest.mark.slow

HUMAN = SUBJECTS / "human_face_m.npz"
FPS = 15.0


def _settings(subject, **changes) -> Recording:
    values = dict(rig="body", cameras=6, frames=7, fps=3.0, views_per_frame=6, size=64, text="")
    values |= dict(seed=1, lively=True, light="studio", motion="showcase")
    return Recording(str(subject), **(values | changes))


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return synthetic_bodies.write_body(tmp_path_factory.mktemp("people") / "tubes.npz")


@pytest.fixture(scope="module", params=["tubes", "human_face_m"])
def subject(request, person):
    if request.param == "tubes":
        return load_subject(str(person), whole=True)
    if not HUMAN.is_file():
        pytest.skip("the shared subjects are not here")
    return load_subject(str(HUMAN), whole=True)


@pytest.fixture(scope="module", autouse=True)
def few_directions():
    """Light from a few directions only: what is tested here does not depend on it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paint, "DIRECTIONS", 6)
        yield


@pytest.fixture(scope="module")
def folder(person, tmp_path_factory):
    out = tmp_path_factory.mktemp("captures") / "one"
    record(_settings(person), out, workers=2)
    return out


def _joints(subject, motion, frames, seed):
    """(F, J, 4, 4) in the world, as `embodied` makes them."""
    times = np.arange(frames) / FPS
    matrices = pose(subject.skeleton, act(subject.skeleton, motion, times, seed))
    matrices[..., :3, 3] += subject.head_in_world
    return matrices


def _path(subject, matrices, joint):
    """(F, 3) where a joint goes."""
    index = subject.skeleton.index(joint)
    at = np.append(subject.skeleton.at[index], 1.0)
    return (matrices[:, index] @ at)[:, :3]


def _soles(subject, matrices):
    """(2, F, S, 3) the lowest vertices of the left and the right shoe."""
    shoes = np.unique(subject.faces[subject.materials == Material.SHOE])
    rest = subject.vertices[shoes]
    low = shoes[rest[:, 1] < rest[:, 1].min() + 0.004]
    feet = []
    for name, side in (("foot.L", 1), ("foot.R", -1)):
        points = subject.vertices[low[side * subject.vertices[low, 0] > 0]]
        foot = matrices[:, subject.skeleton.index(name)]
        moved = np.einsum("fab,sb->fsa", foot[:, :3, :3], points) + foot[:, None, :3, 3]
        feet.append(moved)
    return feet


def test_at_rest_skin_stays_where_it_is(subject):
    bones = subject.skeleton
    rotations = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    matrices = bones.matrices(rotations, np.zeros((1, 3)))
    np.testing.assert_allclose(
        matrices[0], np.tile(np.eye(4), (len(bones.names), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(
        bones.skinned(subject.vertices, matrices[0]), subject.vertices, atol=2e-6
    )


@pytest.mark.skipif(not HUMAN.is_file(), reason="the shared subjects are not here")
def test_a_jumper_turns_from_trunk_to_arm_over_a_hands_breadth(monkeypatch):
    subject = load_npz(HUMAN, whole=True)
    monkeypatch.setattr(bends, "SOFTER", 0)
    hard = load_npz(HUMAN, whole=True)
    steepest = []
    for bones in (subject.skeleton, hard.skeleton):
        np.testing.assert_allclose(bones.weights.sum(1), 1, atol=1e-5)
        knit = subject.faces[subject.materials == Material.CLOTH]
        apart = np.linalg.norm(subject.vertices[knit[:, 0]] - subject.vertices[knit[:, 1]], axis=1)
        change = np.abs(bones.weights[knit[:, 0]] - bones.weights[knit[:, 1]]).sum(1)
        at = bones.at[bones.index("upperarm01.L")]
        near = np.linalg.norm(subject.vertices[knit[:, 0]] - at, axis=1) < 0.1
        steepest.append(np.quantile((change / apart)[near], 0.98))
    assert steepest[0] < 0.6 * steepest[1]
    others = ~np.isin(subject.materials, (Material.CLOTH, Material.TROUSERS))
    kept = np.setdiff1d(subject.faces[others], subject.faces[~others])
    np.testing.assert_array_equal(subject.skeleton.weights[kept], hard.skeleton.weights[kept])


def test_a_bent_elbow_takes_the_hand_along_and_leaves_the_shoulder(subject):
    bones = subject.skeleton
    elbow, wrist = bones.index("lowerarm01.L"), bones.index("wrist.L")
    rotations = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    turn = about(np.array([1.0, 0.0, 0.0]), np.array(0.7))
    rotations[:, elbow] = turn
    matrices = bones.matrices(rotations, np.zeros((1, 3)))[0]
    expected = bones.at[elbow] + turn @ (bones.at[wrist] - bones.at[elbow])
    np.testing.assert_allclose(
        matrices[wrist, :3, :3] @ bones.at[wrist] + matrices[wrist, :3, 3], expected, atol=1e-12
    )
    np.testing.assert_allclose(matrices[bones.index("upperarm01.L")], np.eye(4), atol=1e-12)


_number = st.floats(-1, 1, allow_nan=False)
_vector = st.tuples(_number, _number, _number).map(np.array)


@settings(max_examples=60)
@given(start=_vector, way=_vector, pole=_vector)
def test_two_bones_end_where_they_are_to_reach(start, way, pole):
    length, sideways = np.linalg.norm(way), np.linalg.norm(np.cross(way, pole))
    if length < 0.1 or sideways < 0.05:
        return
    bones = (0.3, 0.25)
    wanted = start + way / length * np.clip(length, 0.06, 0.54)
    bend = reach(start[None], wanted[None], bones, pole[None])
    end = start + bones[0] * bend.upper[0] + bones[1] * bend.lower[0]
    np.testing.assert_allclose(end, wanted, atol=1e-9)
    joint = start + bones[0] * bend.upper[0]
    middle = start + (joint - start) @ way / length**2 * way
    assert (joint - middle) @ pole > 0  # the elbow is on the pole's side
    for bone in (bend.upper[0], bend.lower[0]):
        np.testing.assert_allclose(bone @ bend.hinge[0], 0, atol=1e-9)
    assert np.cross(bend.upper[0], bend.lower[0]) @ bend.hinge[0] > 0


@settings(max_examples=40)
@given(axis=_vector, angle=st.floats(-3, 3), bone=_vector)
def test_swing_and_twist_make_the_rotation(axis, angle, bone):
    if min(np.linalg.norm(axis), np.linalg.norm(bone)) < 0.1:
        return
    axis, bone = axis / np.linalg.norm(axis), bone / np.linalg.norm(bone)
    whole = about(axis, np.array([angle]))
    if (whole[0] @ bone) @ bone < -0.99:
        return  # turned right round: the shortest swing is not unique
    swing, twist = split_twist(whole, bone)
    np.testing.assert_allclose(swing @ about(bone, twist), whole, atol=1e-7)
    np.testing.assert_allclose(swing[0] @ bone, whole[0] @ bone, atol=1e-9)


@pytest.mark.parametrize("motion", ["showcase", "talk", "walk", "sway"])
def test_hands_and_feet_are_where_the_act_wants_them(subject, motion):
    bones = subject.skeleton
    acting = act(bones, motion, np.arange(40) / FPS, seed=2)
    matrices = pose(bones, acting)
    chest = matrices[:, bones.index("spine01")]
    for side, s in enumerate("LR"):
        foot = _path(subject, matrices, f"foot.{s}")
        np.testing.assert_allclose(foot, acting.ankles[side], atol=1e-9)
        at = bones.at[bones.index(f"upperarm01.{s}")] + acting.wrists[side]
        wanted = np.einsum("fab,fb->fa", chest[:, :3, :3], at) + chest[:, :3, 3]
        # Half of the arm's twist turns about a joint that lies beside the bone.
        assert np.linalg.norm(_path(subject, matrices, f"wrist.{s}") - wanted, axis=1).max() < 0.03


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("motion", ["showcase", "talk", "sway"])
def test_who_stands_keeps_both_feet_on_the_floor(subject, motion, seed):
    for sole in _soles(subject, _joints(subject, motion, 60, seed)):
        assert np.abs(sole[..., 1]).max() < 0.005
        np.testing.assert_allclose(sole, np.broadcast_to(sole[:1], sole.shape), atol=1e-9)


def test_who_walks_stands_on_one_foot_at_least(subject):
    heights = [sole[..., 1] for sole in _soles(subject, _joints(subject, "walk", 90, seed=0))]
    lowest = np.stack([h.min(axis=1) for h in heights])  # (2, F)
    assert lowest.min() > -0.001
    assert (np.abs(lowest).min(axis=0) < 0.001).all()
    assert (lowest.max(axis=1) > 0.03).all()
    assert (np.abs(lowest[:, [0, -1]]) < 0.001).all()


@pytest.mark.parametrize("seed", range(4))
def test_showcase_is_calm_then_gestures_then_is_fast(subject, seed):
    frames = 41
    matrices = _joints(subject, "showcase", frames, seed)
    tips = [_path(subject, matrices, f"finger3-3.{s}") for s in "LR"]
    steps = np.max([np.linalg.norm(np.diff(t, axis=0), axis=1) for t in tips], axis=0)  # (40,)
    calm, gesture, fast = steps[:13], steps[14:26], steps[27:]
    assert calm.max() < 0.02
    assert 0.05 < gesture.max() < 0.17
    assert 0.2 < fast.max() < 0.35
    crown = subject.head_in_world[1] + subject.vertices[:, 1].max()
    lifted = np.array([t[:, 1] for t in tips])
    assert lifted[:, 27:].max() > crown > lifted[:, :27].max()


def test_the_head_is_rigid_and_points_are_on_the_mesh(folder, person):
    capture, subject = open_capture(folder), load_subject(str(person), whole=True)
    assert not np.allclose(capture.world_from_head(0), capture.world_from_head(6), atol=1e-3)
    for frame in range(capture.num_frames):
        marks = subject.landmarks(subject.posed(capture.blendshapes(frame)))
        np.testing.assert_allclose(capture.landmarks_3d(frame), marks, atol=1e-5)
        turn = capture.world_from_head(frame)[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        world = capture.world_points(frame)
        assert world.shape == (4000, 3) and -0.001 < world[:, 1].min() < 0.02


def test_points_lie_in_the_masks(folder):
    capture = open_capture(folder)
    for frame in range(capture.num_frames):
        for index, camera in enumerate(capture.cameras):
            pixels, _ = camera.project(capture.world_points(frame))
            x, y = np.floor(pixels).astype(int).T
            inside = np.pad(capture.mask(index, frame), 1)
            around = np.max([inside[y + i, x + j] for i in range(3) for j in range(3)], axis=0)
            assert (around > 0).all()


def test_every_camera_sees_everybody_whole(subject):
    cameras = cameras_of(subject, "body", 12, 128)
    for motion in ("showcase", "walk"):
        matrices = _joints(subject, motion, 41, seed=0)
        for frame in (0, 20, 25, 31, 33):
            skin = subject.skeleton.skinned(subject.vertices, matrices[frame])
            for camera in cameras:
                pixels, _ = camera.project(skin)
                assert (pixels > 0).all() and (pixels < (camera.width, camera.height)).all()


def test_near_cameras_show_the_upper_body_larger(subject):
    far, near = cameras_of(subject, "body", 12, 128)[:8], cameras_of(subject, "body", 12, 128, 4)
    assert [camera.name for camera in near] == [str(n) for n in range(12)]
    for one, other in zip(cameras_of(subject, "body", 8, 128), near[:8], strict=True):
        np.testing.assert_array_equal(one.world_to_camera, other.world_to_camera)
        np.testing.assert_array_equal(one.intrinsics, other.intrinsics)
    head, floor = subject.head_in_world, np.zeros(3)
    for camera in near[8:]:
        assert camera.intrinsics[0, 0] == pytest.approx(2.36 / 0.9 * far[0].intrinsics[0, 0])
        pixels, depth = camera.project(np.stack([head, floor]))
        assert (depth > 0).all() and (pixels[0] > 0).all() and pixels[0, 1] < camera.height / 2
        assert pixels[1, 1] > camera.height
    centers = np.stack([camera.camera_to_world[:3, 3] for camera in near[8:]])
    assert np.degrees(np.arctan2(centers[:, 0], centers[:, 2])) == pytest.approx([-75, -25, 25, 75])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"near": 6}, "near (6) must be less than the number of cameras (6)"),
        ({"near": -1}, "near (-1) must be less than"),
        ({"near": 2, "rig": "head"}, "use --rig body"),
        ({"manner": "grim"}, "there is no manner 'grim': use neutral or friendly"),
    ],
)
def test_near_cameras_and_manners_that_make_no_sense_are_refused(person, tmp_path, changes, words):
    with pytest.raises(SettingsError, match=re.escape(words)):
        record(_settings(person, **changes), tmp_path / "out", 1)
    assert not (tmp_path / "out").exists()


def test_pictures_and_split_of_a_body(folder):
    capture = open_capture(folder)
    assert (capture.fps, capture.num_frames, len(capture.cameras)) == (3.0, 7, 6)
    assert (capture.cameras[0].width, capture.cameras[0].height) == (40, 64)
    assert capture.split.train == tuple(range(7)) and capture.split.test == ()
    assert len(capture.split.test_cameras) == 1
    for frame in range(7):
        for camera in range(6):
            image, mask = capture.image(camera, frame), capture.mask(camera, frame)
            outside = mask == 0
            assert 0.05 < mask.mean() < 0.5
            np.testing.assert_array_equal(image[outside], capture.background(camera)[outside])


def test_cameras_stand_all_around(folder):
    capture = open_capture(folder)
    centers = np.stack([c.camera_to_world[:3, 3] for c in capture.cameras])
    azimuth = np.degrees(np.arctan2(centers[:, 0], centers[:, 2])) % 360
    np.testing.assert_allclose(azimuth, np.arange(6) * 60.0, atol=1e-9)
    assert len(np.unique(centers[:, 1].round(3))) == 3


def test_nothing_is_wrong_with_a_body(folder):
    levels = {finding.what: finding.level for finding in examine(open_capture(folder))}
    assert {w for w, level in levels.items() if level != "ok"} <= {"landmarks"}


def test_the_same_settings_write_the_same_bytes(folder, person, tmp_path):
    record(_settings(person), tmp_path / "again", workers=1)
    for file in folder.rglob("*"):
        if file.is_file():
            again = tmp_path / "again" / file.relative_to(folder)
            assert again.read_bytes() == file.read_bytes(), file.name


def test_another_light_changes_pictures_only(folder, person, tmp_path):
    record(_settings(person, light="warm"), tmp_path / "warm", workers=2)
    one, other = open_capture(folder), open_capture(tmp_path / "warm")
    np.testing.assert_array_equal(one.world_points(3), other.world_points(3))
    np.testing.assert_array_equal(one.mask(2, 3), other.mask(2, 3))
    person_seen = one.mask(0, 0) == 1
    cool, warm = (c.image(0, 0)[person_seen].mean(axis=0) for c in (one, other))
    assert warm[0] / warm[2] > 1.2 * cool[0] / cool[2]


def test_a_head_of_version_1_can_still_be_read(person, tmp_path):
    record(_settings(person, rig="head", views_per_frame=1, frames=11), tmp_path / "old", 1)
    about = json.loads((tmp_path / "old" / "capture.json").read_text())
    del about["shows"]
    (tmp_path / "old" / "capture.json").write_text(json.dumps(about | {"version": 1}))
    capture = open_capture(tmp_path / "old")
    assert capture.split.test == (10,) and capture.head_points(3).shape == (6000, 3)
    (tmp_path / "old" / "capture.json").write_text(json.dumps(about | {"version": 3}))
    with pytest.raises(CaptureError, match="version 3"):
        open_capture(tmp_path / "old")


def test_who_has_no_joints_cannot_be_whole(person, tmp_path):
    bust = synthetic_people.write_person(tmp_path / "bust.npz")
    with pytest.raises((CaptureError, SettingsError)):
        record(_settings(bust), tmp_path / "x", workers=1)
    with pytest.raises(SettingsError, match="motion"):
        record(_settings(person, motion="fly"), tmp_path / "y", workers=1)


@pytest.mark.parametrize("frames", [120, 360])
def test_a_repertoire_takes_the_same_way_in_any_number_of_frames(subject, frames):
    matrices = _joints(subject, "repertoire", frames, seed=0)
    ahead = matrices[:, subject.skeleton.index("head"), :3, 2]
    yaw = np.degrees(np.arctan2(ahead[:, 0], ahead[:, 2]))
    assert yaw.max() > 30 and yaw.min() < -30
    shoulder = _path(subject, matrices, "upperarm01.L")[:, 1]
    for hand in ("wrist.L", "wrist.R"):
        wrist = _path(subject, matrices, hand)
        assert (wrist[:, 1] - shoulder).max() > 0.3 and (wrist[:, 1] - shoulder).min() < -0.35
    feet = [_path(subject, matrices, foot)[:, 1] for foot in ("foot.L", "foot.R")]
    stands = round(0.84 * (frames - 1))
    for foot in feet:
        np.testing.assert_allclose(foot[:stands], foot[0], atol=1e-9)
    assert max(foot[stands:].max() - foot[0] for foot in feet) > 0.05
