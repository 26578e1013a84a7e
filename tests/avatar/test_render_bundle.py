"""What a viewer of a whole person must show."""

import numpy as np
import pytest
import torch

from ico3d.avatar.render_bundle import (
    avatar_gaussians,
    baked_gaussians,
    body_gaussians,
    render_avatar,
    visitor_camera,
)
from ico3d.bundle.format import Bundle
from ico3d.errors import BundleError
from support.bundles.random_body import write_random_body
from support.bundles.random_bundle import write_random_bundle
from support.bundles.random_whole import FRAMES, nodding_poses, write_random_whole

FPS = 15.0
FACE = np.linspace(-1, 1, 39)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Bundle:
    path = tmp_path_factory.mktemp("whole") / "a.ico3d"
    write_random_whole(path)
    return Bundle.open(path)


@pytest.mark.parametrize("frame", [0, 3, 4, FRAMES - 1])
def test_in_a_frame_the_head_has_that_frames_pose(whole, frame):
    found = avatar_gaussians(whole, frame / FPS, FACE)
    body = body_gaussians(whole, frame / FPS)
    head = baked_gaussians(whole.head, FACE).transform(nodding_poses()[frame])
    assert len(found) == len(body) + len(head)
    torch.testing.assert_close(found.means[: len(body)], body.means)
    torch.testing.assert_close(found.means[len(body) :], head.means)
    torch.testing.assert_close(found.colors[len(body) :], head.colors)


def test_between_frames_and_beyond_the_clip(whole):
    means = {
        f: avatar_gaussians(whole, f / FPS, FACE).means[-60:] for f in (1, 1.5, 2, 6, 9, -1, 0)
    }
    torch.testing.assert_close(means[1.5], (means[1] + means[2]) / 2, atol=1e-4, rtol=0)
    assert torch.equal(means[9], means[6]) and torch.equal(means[-1], means[0])


def test_the_face_does_what_the_expression_says(whole):
    a, b = (avatar_gaussians(whole, 0.1, e) for e in (FACE, -FACE))
    assert torch.equal(a.means[:-60], b.means[:-60])
    assert torch.equal(a.colors[:-60], b.colors[:-60])
    assert (a.means[-60:] - b.means[-60:]).norm(dim=1).max() > 1e-3
    assert (a.colors[-60:] - b.colors[-60:]).abs().max() > 0.01


def test_a_picture_of_it(whole):
    camera = visitor_camera(whole.manifest.camera, 32, 48)
    picture = render_avatar(whole, 0.1, FACE, camera)
    assert picture.shape == (48, 32, 3) and picture.std() > 0.01
    behind = render_avatar(whole, 0.1, FACE, camera, np.zeros(3))
    assert behind.mean() < picture.mean()


def test_a_whole_person_has_both(tmp_path):
    write_random_body(tmp_path / "body.ico3d")
    write_random_bundle(tmp_path / "head.ico3d")
    for name, message in (("body", "a body only"), ("head", "no body")):
        with pytest.raises(BundleError, match=message):
            avatar_gaussians(Bundle.open(tmp_path / f"{name}.ico3d"), 0.0, FACE)
