"""What the packaged avatar's body has behind her head takes the colours of the head before it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from bench.demo.matching import JOINT, matched

from ico3d.avatar.baked_body import SkinnedBody
from ico3d.avatar.render_bundle import BakedAvatar, gaussians_at
from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.splat.gaussians import Gaussians
from support.bundles.random_skinned import random_skinned

SECONDS = 0.1
BROWN = (0.4, 0.25, 0.15)


def hung_on(body, joint):
    """The body with all of its Gaussians on one joint."""
    joints = np.full_like(body.joints, body.rig.names.index(joint))
    return replace(body, joints=joints)


def shown(body):
    return gaussians_at(SkinnedBody(body), SECONDS)


def surface(points):
    """A brown head whose surface is around these points."""
    around = points[:, None] + torch.from_numpy(
        np.random.default_rng(2).normal(0, 0.002, (len(points), 20, 3))
    )
    means = around.reshape(-1, 3).float()
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.tensor([1.0, 0, 0, 0]).expand(count, 4),
        scales=torch.full((count, 3), 0.003),
        opacities=torch.full((count,), 0.9),
        colors=torch.tensor(BROWN).expand(count, 3),
    )


def test_what_lies_at_the_heads_surface_is_shown_in_its_colour():
    body = hung_on(random_skinned(60), JOINT)
    before = shown(body)
    after = shown(matched(body, shown, surface(before.means[:30])))
    assert after.colors[:30].numpy() == pytest.approx(np.tile(BROWN, (30, 1)), abs=0.01)
    far = torch.cdist(before.means[30:], before.means[:30]).min(1).values > 0.03
    assert far.sum() > 10
    assert torch.equal(after.colors[30:][far], before.colors[30:][far])
    assert torch.equal(after.means, before.means)


def test_other_parts_of_the_body_keep_their_colours_even_there():
    chest = next(name for name in random_skinned().rig.names if name != JOINT)
    body = hung_on(random_skinned(60), chest)
    before = shown(body)
    assert torch.equal(shown(matched(body, shown, surface(before.means))).colors, before.colors)


def test_the_packaged_person_is_matched_already():
    """A dark Gaussian of her body was a spot on her hair, and a red one a streak at a temple."""
    bundle = Bundle.open(FILE)
    assert bundle.skinned is not None and bundle.animation is not None
    seconds = bundle.animation.rest.end / bundle.animation.fps
    posed = BakedAvatar.of(bundle).gaussians(seconds, bundle.manifest.head.idle_expression)
    count = len(bundle.skinned.means)

    def shown(body):
        return gaussians_at(SkinnedBody(body), seconds)

    again = matched(bundle.skinned, shown, posed[count:])
    change = again.color_logits.astype(float) - bundle.skinned.color_logits
    assert np.abs(change).max(1)[np.abs(change).max(1) > 0].mean() < 0.3
