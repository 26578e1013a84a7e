"""Tied hair: it is combed back, differs by locks, and short fine hairs soften its edge."""

import numpy as np

from ico3d.studio.person.growing import tied, wisps
from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import unit

HEAD = Skull(np.zeros(3), np.full((90, 180), 0.09), 1.0)
TIE = np.array([0.0, 0.01, -0.1])


def _roots(count=2000):
    ways = np.random.default_rng(0).normal((0, 0.8, 0.4), size=(count, 3))
    ways[:, 1] = np.abs(ways[:, 1])
    return 0.09 * unit(ways)


def test_hair_is_combed_back_over_the_head_and_tied():
    roots = _roots()
    points = tied.tied(HEAD, roots, TIE, np.random.default_rng(1)).points
    assert np.linalg.norm(points[:, -1] - TIE, axis=1).max() < 0.012
    front = (roots[:, 2] > 0.05) & (np.abs(roots[:, 0]) < 0.03)
    assert front.sum() > 20
    assert (points[front, 8, 2] < roots[front, 2]).all()
    # No gap opens in the middle: strands beside it are carried aside by as little as they lie so.
    aside = points[front, 4, 0] - roots[front, 0]
    near, far = np.abs(roots[front, 0]) < 0.01, np.abs(roots[front, 0]) > 0.02
    assert np.abs(aside[near]).mean() < 0.6 * np.abs(aside[far]).mean()


def test_strands_of_a_lock_have_a_tone_in_common():
    roots = _roots()
    tone = np.log(tied.tied(HEAD, roots, TIE, np.random.default_rng(2)).tone)
    lock = tied.locks(roots, tied.LOCKS)[0]
    within = np.mean([tone[lock == i].std() for i in range(tied.LOCKS) if (lock == i).sum() > 5])
    assert within < 0.85 * tone.std()


def test_baby_hairs_stay_outside_the_skin_and_at_the_hairline():
    roots = _roots(60)
    random = np.random.default_rng(3)
    short = wisps.baby(HEAD, roots, np.tile([0.0, 0.0, -1.0], (60, 1)), random).points
    assert (np.linalg.norm(short, axis=-1) > 0.09).all()
    assert (np.linalg.norm(short[:, -1] - short[:, 0], axis=1) < 1.6 * wisps.BABY[1]).all()
    assert wisps.near_edge(np.array([-0.02, 0.003, 0.03])).tolist() == [0, 1, 0]
