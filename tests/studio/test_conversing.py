"""A recorded person makes the gestures of the package, then goes through the repertoire."""

import numpy as np
import pytest

from ico3d.errors import SettingsError
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.motion.roles import SIDES
from ico3d.rig.rig import Rig
from ico3d.studio.acting.acting import pose
from ico3d.studio.acting.conversing import CONVERSING, conversing
from ico3d.studio.acting.gestures import act
from ico3d.studio.person.npz_person import load_npz
from ico3d.studio.recording import Recording, record
from support.recordings import synthetic_bodies
from support.shared import SUBJECTS

HUMAN = SUBJECTS / "human_face_m.npz"


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return synthetic_bodies.write_body(tmp_path_factory.mktemp("people") / "tubes.npz")


@pytest.fixture(scope="module")
def bones():
    if not HUMAN.is_file():
        pytest.skip("the shared subjects are not here")
    return load_npz(HUMAN, True).skeleton


def _path(bones, joints, name):
    """(F, 3) where a joint goes."""
    index = bones.index(name)
    return (joints[:, index] @ np.append(bones.at[index], 1.0))[:, :3]


def test_frames_show_the_stroke_of_every_gesture(bones):
    frames = 600
    joints = conversing(bones, np.arange(frames) / 25, seed=0)[: int(CONVERSING * frames)]
    rest = living(Rig(bones.names, tuple(map(int, bones.parents)), bones.at), 0)
    for name, clip in library(rest.person, hung=rest.hung).items():
        wanted = rest.hung.copy()
        wanted[clip.roles] = clip.at(clip.marks.stroke)
        places = rest.person.posed(wanted, np.zeros(3))
        away = [
            _path(bones, joints, f"wrist.{side[0].upper()}") - places[f"{side}_wrist"]
            for side in SIDES
        ]
        # Breath and the shift of weight move shoulders by some centimetres.
        both = np.linalg.norm(away, axis=2).max(axis=0)  # (F,)
        assert both.min() < 0.05, name


def test_feet_stay_on_the_floor_while_hands_gesture(bones):
    joints = conversing(bones, np.arange(100) / 2.4, seed=1)[:45]
    for foot in ("foot.L", "foot.R"):
        path = _path(bones, joints, foot)
        np.testing.assert_allclose(path, np.broadcast_to(path[:1], path.shape), atol=2e-3)


@pytest.mark.parametrize("frames", [1, 2, 60])
def test_the_rest_of_the_time_is_a_repertoire(bones, frames):
    times = np.arange(frames) / 2.4
    joints = conversing(bones, times, seed=3)
    assert joints.shape == (frames, len(bones.names), 4, 4) and np.isfinite(joints).all()
    begun = -(-45 * frames // 100)
    if begun < frames:
        rest = act(bones, "repertoire", times[begun:] - times[begun], 3)
        np.testing.assert_array_equal(joints[begun:], pose(bones, rest))


def test_a_skirt_is_refused(person, tmp_path):
    told = Recording(
        str(person), "body", cameras=2, frames=2, fps=3.0, views_per_frame=2, size=64, text="",
        seed=1, lively=True, light="studio", motion="conversation", garment="skirt",
    )  # fmt: skip
    with pytest.raises(SettingsError, match="skirt"):
        record(told, tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()
