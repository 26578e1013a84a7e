"""Gaussians that have come to lie on another limb."""

import numpy as np
import pytest
import torch

from ico3d.body.planning.windows import Window
from ico3d.body.training.on_bones import EVERY, OnBones
from support.bodies.moving_capture import FRAMES
from support.bodies.tiny_training import trainer_of
from support.bodies.tracked_capture import TrackedCapture

STRAYS = 6


class Hanging(TrackedCapture):
    """The arm is lowered onto the trunk and stays there."""

    lowered = -0.9

    def angle(self, frame):
        return self.lowered

    def _drawn(self, camera, frame):
        return self._taken(camera, frame)  # not those of the arm that swings


@pytest.fixture
def strayed(tmp_path):
    """The trainer of somebody whose arm hangs, and parts of the trunk that have moved onto it."""
    capture = Hanging(tmp_path)
    trainer = trainer_of(capture, "skinned", window=Window(0, FRAMES - 1))
    model = trainer.model
    drawn = model.at(0.5)
    joints = model.gaussians["skin_joints"][:, 0]
    on_arm = torch.nonzero(joints == 1)[:, 0]
    tip = on_arm[drawn.means[on_arm, 0].argsort(descending=True)[:STRAYS]]
    strays = torch.nonzero(joints == 0)[:STRAYS, 0]
    with torch.no_grad():
        model.gaussians["means"][strays] = drawn.means[tip]  # the trunk rests where it is
        model.gaussians["shape_means"][strays] = 0.001
    return capture, model, strays


def test_they_hang_on_that_limb(strayed):
    """Seen as before in the middle of the clip, and gone with the arm when it is raised."""
    capture, model, strays = strayed
    before = model.at(0.5)
    bones = OnBones(model, capture.body_track())
    assert bones.rehang(model, EVERY - 1) == 0
    found = bones.rehang(model, EVERY)
    assert found >= STRAYS
    assert (model.gaussians["skin_joints"][strays, 0] == 1).all()
    assert not model.gaussians["shape_means"][strays].any()
    after = model.at(0.5)
    torch.testing.assert_close(after.means[strays], before.means[strays], atol=2e-3, rtol=0)
    turned = (
        (after.quats * before.quats).sum(1) / after.quats.norm(dim=1) / before.quats.norm(dim=1)
    )
    np.testing.assert_allclose(turned[strays].abs().detach(), 1, atol=1e-5)
    assert bones.rehang(model, EVERY) == 0


def test_what_hangs_well_is_left_alone(tmp_path):
    """An arm that swings, as it begins, but that it faces as the skin does that is nearest now."""
    capture = TrackedCapture(tmp_path)
    model = trainer_of(capture, "skinned", window=Window(0, FRAMES - 1)).model
    before = {name: value.clone() for name, value in model.gaussians.items()}
    assert OnBones(model, None).rehang(model, EVERY) == 0
    assert torch.equal(model.gaussians["normals"], before["normals"])
    model.gaussians["normals"].copy_(-before["normals"])
    assert OnBones(model, capture.body_track()).rehang(model, EVERY) == 0
    normals = before.pop("normals")
    assert ((model.gaussians["normals"] * normals).sum(1) > 0.8).float().mean() > 0.95
    for name, value in before.items():
        assert torch.equal(value, model.gaussians[name]), name


def test_sizes_end_with_the_bone(tmp_path):
    """Those that are short stay as they are."""
    capture = TrackedCapture(tmp_path)
    model = trainer_of(capture, "skinned", window=Window(0, FRAMES - 1)).model
    with torch.no_grad():
        model.gaussians["log_scales"][0] = torch.tensor([0.0, -6.0, -9.0])
    OnBones(model, None).limit_sizes(model)
    bone = np.linalg.norm([0.14, 0.2])
    expected = [np.log(bone / 4), -6.0, -9.0]
    assert model.gaussians["log_scales"][0].tolist() == pytest.approx(expected)
