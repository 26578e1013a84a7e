"""The living rest: feet stay, nothing repeats, one seed is one motion."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.motion.living import Living, living
from ico3d.motion.noise import chance, scrambled, wander
from ico3d.motion.roles import SIDES
from ico3d.rig.quaternions import rotate
from support.rigs import rig_of

TIMES = np.arange(0, 30, 0.1)
STANDING = living(rig_of("SMPL-X", 0.0), 0)


@pytest.fixture(scope="module", params=["A", "T"])
def somebody(request) -> Living:
    rig = rig_of("MakeHuman", 45.0, 35.0) if request.param == "A" else rig_of("SMPL-X", 0.0)
    return living(rig, 5)


def test_feet_stand_still_and_flat(somebody):
    pose, root = somebody.at(TIMES)
    person = somebody.person
    turned, places = person.rig.posed(person.retarget.pose(pose), root)
    for side in SIDES:
        joint = person.retarget.cast.joints[f"{side}_ankle"][0]
        assert np.ptp(places[:, joint], axis=0).max() < 1e-9  # 5 mm are allowed
        toes = rotate(turned[:, joint], np.array([0.0, 0.0, 1.0]))
        np.testing.assert_allclose(toes, np.tile([0, 0, 1.0], (len(TIMES), 1)), atol=1e-9)


def test_knees_bend_forwards_and_hips_shift(somebody):
    pose, root = somebody.at(TIMES)
    places = somebody.person.posed(pose, root)
    for side in SIDES:
        middle = (places[f"{side}_hip"] + places[f"{side}_ankle"]) / 2
        assert (places[f"{side}_knee"] - middle)[:, 2].min() > 0
    assert 0.01 < np.ptp(root[:, 0]) < 0.06
    speed = np.linalg.norm(np.diff(places["head"], axis=0), axis=1) / 0.1
    assert speed.mean() > 0.001 and speed.max() < 0.05


def test_a_breath_takes_four_seconds_and_moves_the_chest(somebody):
    breath = somebody.breath(np.arange(0, 410, 0.05))
    rises = np.count_nonzero((breath[1:] > 0) & (breath[:-1] <= 0))
    assert 97 <= rises <= 103
    assert -1 <= breath.min() < -0.99 and 0.99 < breath.max() <= 1


def test_it_never_repeats(somebody):
    _, root = somebody.at(np.arange(0, 900, 0.5))
    first = root[:60]
    for shift in range(60, len(root) - 60):
        assert np.abs(root[shift : shift + 60] - first).max() > 5e-4


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1e5))
def test_any_seed_at_any_time_is_calm_and_the_same_again(seed, start):
    times = start + np.arange(0, 2, 0.02)
    pose, root = replace(STANDING, seed=seed).at(times)
    assert np.isfinite(pose).all() and np.isfinite(root).all()
    np.testing.assert_allclose(np.linalg.norm(pose, axis=-1), 1, atol=1e-9)
    near = np.abs((pose[1:] * pose[:-1]).sum(-1)).clip(0, 1)
    assert np.degrees(2 * np.arccos(near)).max() / 0.02 < 25
    again, _ = replace(STANDING, seed=seed).at(times[3])
    np.testing.assert_allclose(again, pose[3], atol=1e-12)
    other, _ = replace(STANDING, seed=seed ^ 1).at(times)
    assert np.abs(other - pose).max() > 1e-4


def test_chance_is_one_definition():
    """Values that any port must give."""
    assert [scrambled(), scrambled(0), scrambled(1, 2), scrambled(2, 1)] == EXPECTED
    values = [chance(7, i) for i in range(4000)]
    assert abs(np.mean(values) - 0.5) < 0.02 and min(values) >= 0 and max(values) < 1
    assert float(wander(12.5, 9.7, 3, 1)) == pytest.approx(WANDERED, abs=1e-12)


EXPECTED = [2654435769, 33350994, 3893269270, 587229646]
WANDERED = 0.49668300773900453
