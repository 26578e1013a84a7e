"""How near arms hang to bodies of known widths."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from ico3d.bundle.skinned.baked import WEIGHT_UNIT, BakedSkinned
from ico3d.bundle.skinned.hanging_arms import LIFTS, hung_beside
from ico3d.motion.person import Person, person_of
from ico3d.motion.roles import INDEX, SIDES
from support.recorded import body_of
from support.rigs import rig_of

RIG = rig_of("SMPL-X")
PERSON = person_of(RIG)
ROLES = ("elbow", "wrist", "middle2")
ARM = 0.025
"""Radius of forearms and hands, metres."""
DEPTH = 0.12
"""Half of the depth of the trunk, metres."""
SIDE_BY_SIDE = 0.012
"""Metres by which arm and trunk may overlap or be apart: cells of Gaussians are no surfaces."""


def _body(width: float) -> BakedSkinned:
    """A box of a trunk that is `width` metres to each side, and round forearms and hands."""
    random = np.random.default_rng(5)
    trunk = random.uniform((-width, 0.55, -DEPTH), (width, 1.35, DEPTH), (6000, 3))
    trunk[:3000, 0] = width * np.sign(trunk[:3000, 0])  # its sides
    places, joints = [trunk], [np.full(len(trunk), RIG.index("pelvis"))]
    for side in SIDES:
        for joint, end in pairwise(ROLES):
            start, stop = (PERSON.place(f"{side}_{role}") for role in (joint, end))
            around = random.normal(size=(3000, 3))
            around *= ARM / np.linalg.norm(around, axis=1, keepdims=True)
            places.append(start + random.uniform(0, 1, (3000, 1)) * (stop - start) + around)
            joints.append(np.full(3000, PERSON.cast.joints[f"{side}_{joint}"][0]))
    means, carrier = np.concatenate(places), np.concatenate(joints)
    order = random.permutation(len(means))
    rest = RIG.rest(8)
    body = body_of(RIG, 15.0, rest, np.zeros((8, 3)), len(means))
    return replace(
        body,
        means=means[order].astype(np.float32),
        joints=np.tile(carrier[order, None], (1, 4)).astype(np.uint8),
        weights=np.tile(np.array([WEIGHT_UNIT, 0, 0, 0], np.uint8), (len(means), 1)),
    )


def _inner(person: Person, width: float) -> tuple[float, float]:
    """Lift of the upper arm in radians, and how far arm and trunk are apart in metres."""
    hung = hung_beside(_body(width), person)
    places = person.posed(hung, np.zeros(3))
    upper = places["left_elbow"] - places["left_shoulder"]
    gap = min(float(places[f"left_{role}"][0]) for role in ROLES) - ARM - width
    mirrored = hung[INDEX["right_shoulder"]] * (1, 1, -1, -1)
    np.testing.assert_allclose(mirrored, hung[INDEX["left_shoulder"]], atol=1e-9)
    return float(np.arctan2(upper[0], -upper[1])), gap


@pytest.mark.parametrize("width", [0.16, 0.2, 0.24])
def test_hands_hang_beside_the_trunk_whatever_its_width(width):
    lift, gap = _inner(PERSON, width)
    assert LIFTS[0] < lift < LIFTS[-1]
    one_step = 0.55 * np.diff(LIFTS)[0]  # metres that half a degree moves a hand
    assert -SIDE_BY_SIDE < gap < SIDE_BY_SIDE + one_step


def test_of_a_thin_body_they_hang_straight_down_and_of_the_widest_as_far_out_as_arms_go():
    assert _inner(PERSON, 0.05)[0] == pytest.approx(LIFTS[0], abs=1e-6)
    assert _inner(PERSON, 0.5)[0] == pytest.approx(LIFTS[-1], abs=1e-6)
