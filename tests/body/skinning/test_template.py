"""Points on the template's surface."""

import numpy as np
import pytest

from ico3d.body.skinning.template import Skin, sampled
from support.bodies.moving_capture import FRAMES
from support.bodies.tracked_capture import TrackedCapture


@pytest.fixture
def track(tmp_path):
    """A trunk and an arm that rises."""
    return TrackedCapture(tmp_path).body_track()


def test_points_lie_on_the_surface(track):
    """By area, with the normals and joints of their triangles."""
    skin = sampled(track, 4000, np.random.default_rng(0))
    arm = skin.binding.joints[:, 0] == 1
    axes = np.where(arm[:, None], (0.28, 0.06, 0.06), (0.16, 0.45, 0.12))
    local = (skin.points - np.where(arm[:, None], (0.42, 0.2, 0), 0)) / axes
    assert (np.abs(np.linalg.norm(local, axis=1) - 1) < 0.12).all()
    gradient = local / axes
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.median((gradient * skin.normals).sum(1)) > 0.97
    np.testing.assert_allclose(skin.binding.weights.sum(1), 1, rtol=1e-5)
    corners = track.vertices[track.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    on_arm = track.binding.joints[track.faces[:, 0], 0] == 1
    assert arm.mean() == pytest.approx(areas[on_arm].sum() / areas.sum(), abs=0.03)


def test_pulling_back_undoes_posing(track):
    """Where one joint alone carries a point; joints are those of the nearest point of the skin."""
    skin = sampled(track, 500, np.random.default_rng(0))
    last = FRAMES - 1
    places = skin.posed(track, last)
    back = skin.pulled_back(places, track, last)
    np.testing.assert_allclose(back.points, skin.points, atol=1e-5)
    off = skin.pulled_back(places + 1e-4, track, last)
    np.testing.assert_allclose(off.posed(track, last), places + 1e-4, atol=1e-5)


def test_skins_are_joined(track):
    """One after the other."""
    skin = sampled(track, 30, np.random.default_rng(0))
    both = Skin.joined(skin[:10], skin[np.arange(30) >= 20])
    assert len(both) == 20
    np.testing.assert_array_equal(both.points[10:], skin.points[20:])
