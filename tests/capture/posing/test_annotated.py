"""A recording with annotated key points gets a skeleton from them, without any detector."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.posing.command import Pose
from ico3d.capture.posing.fitting.body import Body, Kinematics
from ico3d.capture.posing.fitting.rows import LandmarkTerm
from ico3d.capture.posing.model.anatomy import anatomy_of
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import COCO_WHOLE_BODY
from ico3d.capture.posing.model.template import load_template
from ico3d.errors import CaptureError
from support.needs import needs
from support.recordings import dna_files

pytestmark = [needs("anny"), pytest.mark.slow]
FRAMES = 5
LOST = 3
"""A frame without points of the torso."""


@pytest.fixture(scope="module")
def true_joints():
    """(FRAMES, J, 3) of a person who lifts an arm and bends elbow, knee and fingers."""
    kinematics, body, _ = _acted()
    return np.stack([kinematics.posed(body, frame).places for frame in range(FRAMES)])


def _acted():
    template = load_template()
    kinematics = Kinematics(template, anatomy_of(template))
    turns = np.tile(np.diag([-1.0, 1.0, -1.0]), (FRAMES, 1, 1))
    body = Body.at_rest(template, np.zeros(0), turns, np.full((FRAMES, 3), [0.1, -0.9, 0.2]))
    body.shape[:] = np.random.default_rng(4).normal(0, 0.7, len(body.shape))
    for joint, bend in (("upperarm01.L", 0.9), ("lowerarm01.L", 0.6), ("lowerleg01.R", 0.7)):
        body.angles[:, template.names.index(joint), 0] = bend * np.linspace(0.2, 1, FRAMES)
    for finger in range(2, 6):
        body.angles[:, template.names.index(f"finger{finger}-1.R"), 0] = 0.5
    count = len(template.landmarks)
    marks = LandmarkTerm(kinematics, np.zeros((FRAMES, count, 3)), np.zeros((FRAMES, count, 3, 3)))
    return kinematics, body, marks


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A DNA-shaped file whose key points are those of that person, to 3 mm, in its own world."""
    kinematics, body, term = _acted()
    points = np.zeros((FRAMES, 133, 3))
    for frame in range(FRAMES):
        marks = term.marks(body, kinematics.posed(body, frame))
        numbers = [kinematics.template.landmarks.index(n) for n in COCO_WHOLE_BODY.values()]
        points[frame, list(COCO_WHOLE_BODY)] = marks[numbers]
    known = points.any(-1, keepdims=True)
    points += known * np.random.default_rng(5).normal(0, 0.003, points.shape)
    points[LOST, [5, 6, 11, 12]] = 0  # not found
    points = points @ np.diag([1.0, -1.0, -1.0])  # the file's world has -y up
    rig = replace(dna_files.Rig(), frames=FRAMES, keypoints=points)
    main = dna_files.write_recording(tmp_path_factory.mktemp("dna"), rig, same_picture=True)
    with h5py.File(main.with_name(f"{main.stem}_annots.smc"), "a") as file:
        del file["Mask"]  # they show somebody else
    return main


def test_joints_come_back_and_a_lost_frame_is_interpolated(recording, true_joints, capsys):
    Pose(recording, workers=1).run()
    track = open_capture(recording).body_track()
    assert track is not None and track.fitted.tolist() == [True] * LOST + [False, True]
    # Key points are about these joints; what lies between them, such as the spine, follows.
    bones = load_template().names
    seen = [track.rig.index(mark.bone) for mark in LANDMARKS.values() if mark.bone in bones]
    off = np.linalg.norm(track.joints() - true_joints, axis=-1)[track.fitted][:, seen]
    assert np.median(off) < 0.006 and np.percentile(off, 95) < 0.015
    middle = 0.5 * (track.joints()[LOST - 1] + track.joints()[LOST + 1])
    assert np.linalg.norm(track.joints()[LOST] - middle, axis=-1).max() < 0.02
    said = capsys.readouterr().err
    assert f"frames {LOST} are interpolated" in said and "4 of 5 frames fitted" in said


def test_without_a_torso_it_says_what_lacks_and_what_to_do(recording, tmp_path):
    points = np.zeros((2, 133, 3))
    points[:, [5, 6, 7]] = 0.3
    rig = replace(dna_files.Rig(), frames=2, keypoints=points)
    main = dna_files.write_recording(tmp_path, rig, same_picture=True)
    with pytest.raises(CaptureError, match=r"never seen: .*hip\.L.*--method swings\+\+"):
        Pose(main, workers=1).run()
    assert open_capture(main).body_track() is None
