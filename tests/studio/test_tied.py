"""Tied hair: it shows a parting, differs by locks, and short fine hairs soften its edge."""

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


def test_hair_in_front_leaves_the_parting_to_its_own_side():
    roots = _roots()
    aside, opened = tied.parting(HEAD, roots)
    points = tied.tied(HEAD, roots, TIE, np.random.default_rng(1)).points
    near = (opened > 0.9) & (np.abs(aside) < 0.01) & (roots[:, 1] > 0.05)
    later = tied.parting(HEAD, points[near, 5])[0]
    assert near.sum() > 20
    assert (np.sign(aside[near]) * (later - aside[near]) > 0).mean() > 0.95


def test_strands_of_a_lock_have_a_tone_in_common():
    roots = _roots()
    tone = np.log(tied.tied(HEAD, roots, TIE, np.random.default_rng(2)).tone)
    lock = tied.locks(roots, tied.LOCKS)[0]
    within = np.mean([tone[lock == i].std() for i in range(tied.LOCKS) if (lock == i).sum() > 5])
    assert within < 0.85 * tone.std()


def test_wisps_stay_outside_the_skin_and_baby_hairs_at_the_hairline():
    roots = _roots(60)
    random = np.random.default_rng(3)
    fallen = wisps.framing(HEAD, roots, np.arange(60) % len(wisps.FRAMING), random).points
    assert (np.linalg.norm(fallen[:, 1:], axis=-1) > 0.09 + 0.9 * wisps.OFF).all()
    short = wisps.baby(HEAD, roots, np.tile([0.0, 0.0, -1.0], (60, 1)), random).points
    assert (np.linalg.norm(short, axis=-1) > 0.09).all()
    assert (np.linalg.norm(short[:, -1] - short[:, 0], axis=1) < 1.6 * wisps.BABY[1]).all()
    assert wisps.near_edge(np.array([-0.02, 0.003, 0.03])).tolist() == [0, 1, 0]
