"""Hands whose shade is taken out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from ico3d.avatar.baking.skinned.hands import AROUND, KEPT, evened
from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import NAME, bundle_path
from ico3d.motion.roles import cast
from support.bundles.skinned_person import capsule_person

SKIN = np.array([1.0, 0.4, 0.1], np.float32)  # logits of r, g, b
SHADE = 2.0


@pytest.fixture(scope="module")
def arm():
    """The left arm of the packaged person from the elbow on: evenly coloured, and along the hand.

    The second is how far each Gaussian is from the wrist towards the middle finger's tip, metres.
    """
    body = Bundle.open(bundle_path(NAME)).skinned
    assert body is not None
    roles = cast(body.rig)
    elbow, wrist, middle = (roles.place(f"left_{part}") for part in ("elbow", "wrist", "middle1"))
    near = np.linalg.norm(body.means - wrist, axis=1) < np.linalg.norm(elbow - wrist)
    body = body.chosen(np.flatnonzero(near & (body.opacities > 100)))
    colors = np.tile(SKIN, (len(body.means), 1)).astype(np.float16)
    along = (body.means - wrist) @ (middle - wrist) / np.linalg.norm(middle - wrist)
    return replace(body, color_logits=colors), along


def darkened(body, which):
    return replace(body, color_logits=body.color_logits - np.float16(SHADE) * which[:, None])


def test_shaded_fingers_are_as_bright_as_the_palm(arm):
    body, along = arm
    fingers = along > 0.07
    found = evened(darkened(body, fingers)).color_logits.astype(np.float32)
    inside = along > 0.07 + 2 * AROUND
    assert inside.sum() > 100
    np.testing.assert_allclose(found[inside], np.tile(SKIN, (inside.sum(), 1)), atol=0.02)
    palm = (along > 0.04) & (along < 0.07 - 2 * AROUND)
    np.testing.assert_allclose(found[palm], np.tile(SKIN, (palm.sum(), 1)), atol=0.01)


def test_a_ring_stays_dark_and_so_does_a_sleeve(arm):
    body, along = arm
    ring = np.zeros(len(along), bool)
    # A dark spot alone among few is what shade would be.
    amid = [len(near) > 6 for near in KDTree(body.means).query_ball_point(body.means, AROUND)]
    ring[np.flatnonzero((along > 0.07) & amid)[::40]] = True
    sleeve = along < 0
    found = evened(darkened(body, ring | sleeve)).color_logits.astype(np.float32)
    assert (found[ring].mean(1) < SKIN.mean() - 0.6 * SHADE).mean() > 0.9
    np.testing.assert_allclose(found[sleeve], np.tile(SKIN - SHADE, (sleeve.sum(), 1)), atol=0.01)


def test_what_shapes_know_of_recorded_poses_counts_less_on_hands(arm):
    body, along = arm
    kept = evened(body).shape_scales[:, 1] / body.shape_scales[:, 1].astype(np.float32)
    np.testing.assert_allclose(kept[along > 0.1], KEPT, atol=0.01)
    np.testing.assert_allclose(kept[along < 0], 1, atol=0.01)
    np.testing.assert_array_equal(evened(body).shape_scales[:, 0], body.shape_scales[:, 0])


def test_a_rig_without_fingers_is_left_alone():
    body = capsule_person(100)
    assert evened(body) is body or np.array_equal(evened(body).color_logits, body.color_logits)
