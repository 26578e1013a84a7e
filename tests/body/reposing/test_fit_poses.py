"""Poses that pictures correct, through a body that stays as it is."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.body.model_folder import TrainedBody
from ico3d.body.planning.windows import Window
from ico3d.body.reposing import fit_poses
from ico3d.capture.pictures import train_cameras
from ico3d.errors import SettingsError
from ico3d.rig.quaternions import to_rotvec
from support.bodies.moving_capture import FRAMES
from support.bodies.tiny_training import trainer_of
from support.bodies.tracked_capture import TrackedCapture

FRAME = 6


@pytest.fixture
def body(tmp_path):
    """A body that only just begins, on a skin that is where it was recorded."""
    begun = trainer_of(TrackedCapture(tmp_path), "skinned", window=Window(0, FRAMES - 1)).model
    return TrainedBody([begun], (Window(0, FRAMES - 1),), 15.0, "skinned", {})


def test_a_shoulder_finds_its_angle(body, tmp_path, monkeypatch):
    """Ten degrees off, as far as soft Gaussians tell; all else, test cameras too, is left alone."""
    monkeypatch.setattr(fit_poses, "RATE", replace(fit_poses.RATE, initial=1e-2))
    capture = TrackedCapture(tmp_path, 10.0)
    track = capture.body_track()
    assert track is not None
    seen = set()
    image = capture.image
    capture.image = lambda camera, frame: seen.add((camera, frame)) or image(camera, frame)
    before = {name: value.detach().clone() for name, value in body.models[0].gaussians.items()}
    found = fit_poses.fitted_poses(body, capture, track, [FRAME])
    angles = [to_rotvec(one.rotations[FRAME, 1].astype(float))[2] for one in (track, found)]
    off = np.degrees(np.abs(np.array(angles) - capture.angle(FRAME)))
    assert off[0] == pytest.approx(10, abs=1e-3) and off[1] < 5
    np.testing.assert_allclose(np.linalg.norm(found.rotations[FRAME], axis=-1), 1, atol=1e-6)
    others = np.arange(FRAMES) != FRAME
    np.testing.assert_array_equal(found.rotations[others], track.rotations[others])
    assert {camera for camera, _ in seen} <= set(train_cameras(capture))
    assert {frame for _, frame in seen} == {FRAME}
    for name, value in body.models[0].gaussians.items():
        assert torch.equal(value, before[name])


def test_it_needs_a_skeleton(tmp_path):
    capture = TrackedCapture(tmp_path)
    model = trainer_of(capture, "static").model
    body = TrainedBody([model], (Window(4, 8),), 15.0, "static", {})
    with pytest.raises(SettingsError, match="--method skinned"):
        fit_poses.fitted_poses(body, capture, capture.body_track(), [FRAME])
