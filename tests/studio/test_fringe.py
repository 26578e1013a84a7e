"""A fringe: it leaves eyes and mouth free, and mostly cheeks and ears, too."""

import numpy as np

from ico3d.studio.person.growing import fringe
from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import unit

RADIUS = 0.09
HEAD = Skull(np.zeros(3), np.full((90, 180), RADIUS), 1.0)
EYES = 25.0
"""Degrees from the middle within which eyes, nose and mouth lie."""


def _grown():
    """Roots of a fringe, and its strands: places all over the head, of which some belong to it."""
    places = RADIUS * unit(np.random.default_rng(0).normal(size=(20_000, 3)))
    roots = places[fringe.belongs(HEAD, places)]
    return roots, fringe.curtain(HEAD, roots, np.random.default_rng(1)).points


def test_it_begins_at_the_hairline_in_front():
    roots, points = _grown()
    assert len(roots) > 200
    inside = HEAD.inside_hairline(roots)
    assert inside.min() > -0.002 and inside.max() < fringe.DEEPEST
    assert (np.abs(np.arctan2(roots[:, 0], roots[:, 2])) < fringe.WIDEST).all()
    assert np.linalg.norm(points[:, 0] - roots, axis=1).max() < 0.004


def test_locks_lie_on_their_side_of_the_parting_and_few_hang_before_the_ears():
    roots, points = _grown()
    turn = np.arctan2(roots[:, 0], roots[:, 2]) - fringe.PARTING
    clear = np.abs(turn) > 0.15  # near the parting a strand may fall to either side
    assert (np.sign(points[clear, -1, 0]) == np.sign(turn[clear])).all()
    ends = np.degrees(np.abs(np.arctan2(points[:, -1, 0], points[:, -1, 2])))
    assert np.percentile(ends, 1) > EYES + 15
    assert roots[:, 1].min() > 0
    hanging = ends < 90
    assert 0.1 < hanging.mean() < 0.35
    assert np.median(points[hanging, -1, 1]) < -0.4 * RADIUS
    assert np.abs(points[~hanging, -1, 1]).max() < 0.45 * RADIUS and np.median(ends) > 100


def test_it_leaves_the_face_free_and_lies_on_the_skin():
    points = _grown()[1].reshape(-1, 3)
    height = np.linalg.norm(points, axis=1) - RADIUS
    assert np.percentile(height, 1) > -0.003 and height.max() < 0.04
    turn = np.degrees(np.abs(np.arctan2(points[:, 0], points[:, 2])))
    face = (turn < EYES) & (points[:, 1] < 0.1 * RADIUS)
    assert face.mean() < 0.001
