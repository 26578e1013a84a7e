"""Cloth bends over a hand's breadth where limbs leave the trunk."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.studio.choice import load_subject
from ico3d.studio.person import bends
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import Material
from support.recordings import synthetic_people

JOINTS = ("upperarm01.L", "upperarm01.R", "upperleg01.L", "upperleg01.R")
AT = np.array([[0.2, 0.4, 0], [-0.2, 0.4, 0], [0.1, 0.0, 0], [-0.1, 0.0, 0]])


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    """A person who is a sheet of trousers from hip to hip, each half on its own leg."""
    path = synthetic_people.write_person(tmp_path_factory.mktemp("people") / "block.npz")
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 61), np.linspace(-0.3, 0.1, 41))
    at = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).astype(np.float32)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    weights = np.zeros((len(at), 4), np.float32)
    weights[at[:, 0] >= 0, 2] = weights[at[:, 0] < 0, 3] = 1
    return replace(
        load_subject(str(path)),
        vertices=at,
        faces=faces.astype(np.int32),
        materials=np.full(len(faces), Material.TROUSERS, np.uint8),
        skeleton=Skeleton(JOINTS, np.full(4, -1), AT, weights),
    )


def test_trousers_go_over_from_one_leg_to_the_other_where_these_meet(sheet):
    soft = bends.with_soft_bends(sheet).skeleton.weights
    np.testing.assert_allclose(soft.sum(axis=1), 1, atol=1e-5)
    fork = np.abs(sheet.vertices[:, 1] + bends.BELOW) < 0.004
    left = soft[fork, 2][np.argsort(sheet.vertices[fork, 0])]
    assert (np.diff(left) >= -1e-6).all()
    assert np.abs(np.diff(sheet.skeleton.weights[fork, 2])).max() == 1
    assert np.diff(left).max() < 0.15


def test_cloth_far_from_the_bend_stays_as_the_file_hangs_it(sheet):
    soft = bends.with_soft_bends(sheet).skeleton.weights
    far = np.linalg.norm(sheet.vertices - (0, -bends.BELOW, 0), axis=1) > 0.25
    np.testing.assert_allclose(soft[far], sheet.skeleton.weights[far], atol=0.02)


def test_a_bust_has_no_joints_to_bend_at(sheet):
    bust = replace(sheet, skeleton=None)
    assert bends.with_soft_bends(bust) is bust
