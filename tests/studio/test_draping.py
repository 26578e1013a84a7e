"""A jumper hangs: longer than the body around it, on it and not in it, held by its ribs."""

from itertools import pairwise

import numpy as np
import pytest

from ico3d.studio.dress.draping import INSIDE, draped
from ico3d.studio.dress.tailoring import tailored
from ico3d.studio.person.skeleton import about
from support.recordings.sleeves import sleeved

RINGS, SIDES, RADIUS = 70, 40, 0.05


@pytest.fixture(scope="module")
def hung(tmp_path_factory):
    """A sleeve of a fine mesh, as it lay and as it hangs."""
    close = sleeved(tmp_path_factory.mktemp("people"), RINGS, SIDES, RADIUS)
    return close, draped(close)


def _from_arm(person, vertices):
    """Metres of vertices (V, 3) from the axis of the upper or the lower arm, the nearer."""
    bones = person.skeleton
    joints = [bones.at[bones.index(f"{n}.L")] for n in ("upperarm01", "lowerarm01", "wrist")]
    away = []
    for start, end in pairwise(joints):
        bone = end - start
        part = np.clip((vertices - start) @ bone / (bone @ bone), 0, 1)[:, None]
        away.append(np.linalg.norm(vertices - start - part * bone, axis=1))
    return np.min(away, axis=0)


def _area(person):
    a, b, c = person.vertices[person.faces].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_cloth_is_wider_than_the_arm_and_lies_on_it(hung):
    close, loose = hung
    assert loose.draped and not close.draped
    assert 1.04 < _area(loose) / _area(close) < 1.16
    away, before = (_from_arm(p, p.vertices) for p in (loose, close))
    assert (away - before).min() > -INSIDE - 0.001
    assert 0.002 < (away - before).max() < 0.03


def test_ribs_at_the_edges_hold_on_to_the_body(hung):
    close, loose = hung
    ribs = tailored(close).fields[:, 3] < 0.9
    assert 0.1 < ribs.mean() < 0.5
    np.testing.assert_allclose(loose.vertices[ribs], close.vertices[ribs], atol=1e-5)


def test_cloth_hangs_below_the_arm(hung):
    close, loose = hung
    moved = _from_arm(loose, loose.vertices) - _from_arm(close, close.vertices)
    bones = close.skeleton
    start, end = (bones.at[bones.index(f"{n}.L")] for n in ("upperarm01", "lowerarm01"))
    bone = (end - start) / np.linalg.norm(end - start)
    down = -np.eye(3)[1] + bone * bone[1]
    down /= np.linalg.norm(down)  # across the arm
    upper = close.vertices.reshape(RINGS, SIDES, 3)[8:30]
    depth = (upper - upper.mean(axis=1, keepdims=True)) @ down / RADIUS  # 1 at its lowest
    moved = moved.reshape(RINGS, SIDES)[8:30]
    assert moved[depth > 0.6].mean() > 1.5 * moved[depth < -0.6].mean() > 0


def test_a_jumper_is_draped_alike_each_time(hung):
    close, loose = hung
    np.testing.assert_array_equal(draped(close).vertices, loose.vertices)


def test_folds_move_with_the_arm(hung):
    close, loose = hung
    bones = close.skeleton
    turns = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    turns[:, bones.index("upperarm01.L")] = about(np.array([0.0, 0.0, 1.0]), np.array(0.7))
    matrices = bones.matrices(turns, np.zeros((1, 3)))[0]
    apart = [
        np.linalg.norm(at(loose.vertices) - at(close.vertices), axis=1)
        for at in (lambda v: v, lambda v: bones.skinned(v, matrices))
    ]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-6)


def test_a_mesh_too_coarse_for_folds_stays_as_it_is(tmp_path):
    coarse = sleeved(tmp_path, 30, 16, RADIUS)
    assert draped(coarse) is coarse
