"""Values of any pose out of those of a few."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.rig.pose_regression import REACH, RIDGE, PoseRegression, features, kernel_width
from ico3d.rig.quaternions import from_rotvec


def bent(angles) -> np.ndarray:
    """(P, 1, 4) a single joint turned about x by P angles."""
    turns = np.zeros((len(angles), 1, 3))
    turns[:, 0, 0] = angles
    return from_rotvec(turns)


def of(known: np.ndarray, values) -> PoseRegression:
    return PoseRegression(known, np.asarray(values, float), kernel_width(known))


def test_two_poses_by_hand():
    """Mean and weights have a closed form, in between and beside."""
    side = np.sin(0.25)
    known, width = bent((-0.5, 0.5)), REACH * side
    found = of(known, [[1.0], [3.0]])

    def alike(apart: float) -> float:
        return np.exp(-(apart**2) / (2 * width**2))

    for angle in (0.0, 0.2, -0.4):
        here = np.sin(angle / 2)
        weight = 1 / (1 + RIDGE - alike(2 * side))
        expected = 2 + weight * (alike(here - side) - alike(here + side))
        np.testing.assert_allclose(found.at(bent([angle])[0]), [expected], atol=1e-12)


def test_between_known_poses_values_go_on_smoothly():
    """Every second of 21 angles is known; a sine of the angle comes back at the others."""
    angles = np.linspace(-1.5, 1.5, 21)
    found = of(bent(angles[::2]), np.sin(2 * angles[::2])[:, None])
    for angle in angles[1::2]:
        assert found.at(bent([angle])[0])[0] == pytest.approx(np.sin(2 * angle), abs=0.06)


def test_far_from_all_known_poses_values_are_their_mean():
    found = of(bent((0.0, 0.02, 0.05)), [[0.0, 5.0], [1.0, 5.0], [5.0, 5.0]])
    np.testing.assert_allclose(found.at(bent([3.0])[0]), [2.0, 5.0], atol=1e-6)


@given(st.integers(0, 10_000))
def test_values_never_leave_the_known_range(seed):
    rng = np.random.default_rng(seed)
    known = from_rotvec(rng.normal(0, 1, (6, 4, 3)))
    values = rng.normal(0, 1, (6, 3))
    found = of(known, values).at(from_rotvec(rng.normal(0, 1.5, (4, 3))))
    assert (found <= values.max(0)).all() and (found >= values.min(0)).all()


def test_known_twice_or_alone():
    """Equal poses give the mean of what they tell; a single one its own values, everywhere."""
    np.testing.assert_allclose(of(bent((0.3, 0.3)), [[1.0], [2.0]]).at(bent([0.3])[0]), [1.5])
    np.testing.assert_allclose(of(bent([0.3]), [[7.0]]).at(bent([-2.0])[0]), [7.0])
    assert kernel_width(bent([0.3])) == 1.0


def test_features_do_not_depend_on_the_sign_or_length_of_quaternions():
    quats = from_rotvec(np.random.default_rng(0).normal(0, 1, (5, 3, 3)))
    np.testing.assert_allclose(features(-2 * quats), features(quats), atol=1e-12)


def test_the_packaged_person_is_shaded_in_poses_that_were_left_out():
    """Every other recorded pose tells of the ones between, whose shapes' coefficients are known."""
    body = Bundle.open(Path(FILE)).skinned
    assert body is not None
    poses = np.repeat(body.held[None] / 32767, body.info.num_frames, 0)
    poses[:, body.moving] = body.rotations / 32767
    values = body.coefficients.astype(float)
    found = PoseRegression(poses[::2], values[::2], float(body.kernel_width[0]))
    missed = np.stack([found.at(pose) for pose in poses[1::2]]) - values[1::2]
    told = 1 - np.square(missed).sum() / np.square(values[1::2] - values.mean(0)).sum()
    assert told > 0.78
