"""Frames that cannot be fitted lie between those that were."""

import numpy as np

from ico3d.capture.posing.report import gaps, runs
from ico3d.capture.posing.tracking import between
from ico3d.rig.quaternions import from_rotvec, to_rotvec


def test_rotations_go_the_shortest_way_and_ends_stand_still():
    turns = from_rotvec(np.array([[[0, 0, 0.2]], [[0, 0, 0.8]]]))
    rotations, roots = between(turns, np.array([[0.0, 0, 0], [4.0, 0, 0]]), np.array([1, 4]), 6)
    np.testing.assert_allclose(
        to_rotvec(rotations)[:, 0, 2], [0.2, 0.2, 0.4, 0.6, 0.8, 0.8], atol=1e-9
    )
    np.testing.assert_allclose(roots[:, 0], [0, 0, 4 / 3, 8 / 3, 4, 4])


def test_gaps_and_runs_of_frames():
    assert gaps(np.array([0, 1, 1, 0, 0, 1], bool)) == [(0, 0), (3, 4)]
    assert runs(5) == [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4)]
    assert [len(range(a, b + 1)) for a, b in runs(100)] == [8, 9, 8, 8, 9, 8, 8, 9, 8, 8, 9, 8]
