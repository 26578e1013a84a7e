"""Bodies on a skeleton out of a bundle: what is drawn is what training draws."""

import numpy as np
import pytest
import torch

from ico3d.avatar.baked_body import SkinnedBody, body_of, gaussians_at, skinned_gaussians
from ico3d.avatar.film.actor import bundle_actor
from ico3d.avatar.render_bundle import body_gaussians, render_body, visitor_camera
from ico3d.body.skinning.skinned import Pose, Skinned
from ico3d.bundle.format import Bundle
from ico3d.bundle.skinned.posing import any_pose, recorded_pose
from ico3d.rig.quaternions import from_rotvec
from support.bodies.skinned_model import trained_like
from support.bundles.random_skinned import random_skinned, write_random_skinned

FPS = 15.0


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Bundle:
    path = tmp_path_factory.mktemp("skinned") / "a.ico3d"
    write_random_skinned(path)
    return Bundle.open(path)


@pytest.mark.parametrize("recorded", [True, False])
def test_a_baked_body_is_drawn_as_the_trained_one(recorded):
    baked = random_skinned(40)
    away = from_rotvec(np.random.default_rng(1).normal(0, 0.8, (5, 3)))
    pose = recorded_pose(baked, 2.4) if recorded else any_pose(baked, away, np.array([0.1, 0, -2]))
    model = trained_like(baked)
    motion = model.motion
    assert isinstance(motion, Skinned)
    values = {**model.gaussians, **model.shared}
    parts = (torch.from_numpy(part).float() for part in (pose.rotations, pose.root, pose.residual))
    expected, found = motion.drawn(values, Pose(*parts)), skinned_gaussians(baked, pose)
    torch.testing.assert_close(found.means, expected.means, atol=2e-5, rtol=0)
    torch.testing.assert_close(found.colors, expected.colors, atol=2e-5, rtol=0)
    torch.testing.assert_close(found.scales, expected.scales)
    torch.testing.assert_close(found.opacities, expected.opacities, atol=1e-5, rtol=0)
    turned = torch.nn.functional.normalize(expected.quats)
    torch.testing.assert_close((found.quats * turned).sum(1).abs(), torch.ones(40))


def test_the_clip_is_one_window(bundle):
    body = body_of(bundle)
    assert isinstance(body, SkinnedBody) and body.fps == FPS
    assert [(span.first, span.last) for span in body.windows] == [(0, 5)]
    for seconds, frame in ((0.0, 0), (2.5 / FPS, 2.5), (9.0, 5), (-1.0, 0)):
        expected = skinned_gaussians(body.baked, recorded_pose(body.baked, frame))
        torch.testing.assert_close(gaussians_at(body, seconds).means, expected.means)


def test_it_is_filmed_in_its_recorded_motion(bundle):
    actor = bundle_actor(bundle)
    assert actor.seconds == pytest.approx(5 / FPS)
    drawn = actor.draw(0.2, np.zeros(0))
    torch.testing.assert_close(drawn.means, body_gaussians(bundle, 0.2).means)
    picture = render_body(bundle, 0.2, visitor_camera(bundle.manifest.camera, 32, 48))
    assert picture.shape == (48, 32, 3) and picture.std() > 0.01
