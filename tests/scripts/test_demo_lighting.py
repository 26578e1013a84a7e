"""The window's light that is put on the packaged avatar, and where she rests."""

from dataclasses import replace

import numpy as np
import pytest
from bench.demo.lighting import LIT, STRENGTH, TINT, WINDOW, lit_body, lit_head

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.bundle.skinned.posing import harmonics, joint_table, recorded_pose
from support.bundles.random_bundle import random_head
from support.bundles.random_skinned import random_skinned

TOWARDS = np.array(WINDOW) / np.linalg.norm(WINDOW)


def gains_of_a_head():
    """Normals (N, 3) of an ellipsoid's Gaussians, and what their logits gain (N, 3)."""
    head = random_head(4000, rank=2)
    outwards = unit(head.means / np.square((0.08, 0.11, 0.09)))
    grey = head.mean_logits.copy()
    grey[:, :3] = 0.0
    head = replace(head, mean_logits=grey)
    return outwards, lit_head(head).mean_logits.astype(float)[:, :3]


def test_a_head_is_brightest_towards_the_window_and_loses_its_light_on_the_other_side():
    outwards, gains = gains_of_a_head()
    facing = outwards @ TOWARDS
    assert gains[facing > 0.97].mean(0) == pytest.approx(LIT, abs=0.06)
    lost = gains[facing > 0.97].mean(0) - gains[facing < -0.5].mean(0)
    assert lost == pytest.approx(np.log1p(STRENGTH) * np.array(TINT), rel=0.2)  # smooth light
    bands = [gains[abs(facing - at) < 0.1].mean() for at in (-0.4, 0.0, 0.4, 0.8)]
    assert bands == sorted(bands)


def test_the_light_comes_from_her_right_and_from_above():
    outwards, gains = gains_of_a_head()
    for axis, sign in ((0, -1), (1, 1), (2, 1)):
        side = sign * outwards[:, axis]
        assert gains[side > 0.8].mean() > gains[side < -0.8].mean() + 0.2


def test_skin_through_which_light_went_does_not_glow():
    head = random_head(4000, rank=2)
    logits = head.mean_logits.copy()
    logits[:, :3] = 0.0
    logits[::50, 0] = 3.0
    red = lit_head(replace(head, mean_logits=logits)).mean_logits.astype(float)
    excess = red[::50, 0] - red[::50, 1]
    assert excess.max() < 1.4
    assert (red[:, 0] - red[:, 1]).min() > -0.2


def plain(body):
    """A body of one place, whose normals lean to all sides of one direction, in an old light."""
    rng = np.random.default_rng(1)
    count = len(body.means)
    normals = np.array([0.0, 0.0, 1.0]) + rng.normal(0, 0.25, (count, 3))
    normals = 127 * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(
        body,
        means=rng.normal(0, 0.004, (count, 3)).astype(np.float32),
        opacities=np.full(count, 255, np.uint8),
        normals=np.round(normals).astype(np.int8),
    )


def unit(vectors):
    return vectors / np.linalg.norm(vectors.astype(float), axis=1, keepdims=True)


def test_a_body_keeps_the_light_that_it_had_and_is_lit_as_its_even_surface_faces():
    old = plain(random_skinned(400))
    new = lit_body(old)
    assert unit(new.normals).std(0).max() < 0.3 * unit(old.normals).std(0).max()
    had = old.color_logits + harmonics(unit(old.normals)) @ old.light
    have = new.color_logits + harmonics(unit(new.normals)) @ new.light
    outwards, gains = gains_of_a_head()
    ahead = gains[outwards[:, 2] > 0.97].mean(0)
    assert (have - had).mean(0) == pytest.approx(ahead, abs=0.08)
    assert (have - had).std(0).max() < 0.05


def test_both_sides_of_something_thin_keep_facing_their_own_way():
    old = plain(random_skinned(400))
    normals = old.normals.copy()
    normals[::2, 2] *= -1
    new = lit_body(replace(old, normals=normals))
    assert (np.sign(new.normals[:, 2]) == np.sign(normals[:, 2])).mean() > 0.99


def test_the_packaged_person_rests_with_hanging_hands():
    bundle = Bundle.open(FILE)
    body, animation = bundle.skinned, bundle.animation
    assert body is not None and animation is not None and animation.rest is not None
    hips = body.rig.joints[body.rig.names.index("upperleg01.L"), 1]
    for frame in range(animation.rest.start, animation.rest.end + 1):
        table = joint_table(body, recorded_pose(body, frame))
        for name in ("wrist.L", "wrist.R"):
            joint = body.rig.names.index(name)
            matrix = table[joint, :12].reshape(3, 4)
            wrist = matrix[:, :3] @ body.rig_joints[joint] + matrix[:, 3]
            assert wrist[1] < hips + 0.05, (frame, name)
