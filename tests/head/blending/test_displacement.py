"""Displacements that follow landmarks: closed forms, and what is no evidence of movement."""

import numpy as np
import pytest

from ico3d.head.blending.displacement import LEAST_FRAMES, Displacement, principal, told

LANDMARKS = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.05, 0.0]])
MODES = np.random.default_rng(0).normal(size=(2, 3, 3)) * 0.003
NOTHING = np.zeros((3, 3))


def _recording(frames=200):
    """Expressions of four values, of which two move the landmarks, and how those move."""
    rng = np.random.default_rng(1)
    expressions = rng.normal(size=(frames, 4)) * (0.3, 2.0, 1.0, 1.0) + (5.0, 0.0, 1.0, 0.0)
    drives = (expressions[:, :2] - (5.0, 0.0)) / (0.3, 2.0)
    return expressions, np.einsum("fm,mpc->fpc", drives, MODES)


def test_components_bring_the_movement_back():
    _, motion = _recording()
    found = principal(LANDMARKS, motion, 6)
    assert found.modes.shape == (2, 3, 3)  # of six: there are no more
    back = found.mean + np.einsum("fm,mpc->fpc", found.coefficients(motion), found.modes)
    np.testing.assert_allclose(back, motion, atol=1e-8)


def test_coefficients_have_a_mean_of_0_and_a_size_of_1():
    motion = _recording()[1]
    values = principal(LANDMARKS, motion, 2).coefficients(motion)
    np.testing.assert_allclose(values.mean(0), 0, atol=1e-6)
    np.testing.assert_allclose(np.square(values).mean(0), 1, rtol=1e-5)


def test_the_strongest_come_first_and_no_more_than_wanted():
    motion = _recording()[1]
    whole, one = (principal(LANDMARKS, motion, count) for count in (6, 1))
    sizes = np.square(whole.modes).sum((1, 2))
    assert (np.diff(sizes) < 0).all() and len(one.modes) == 1
    np.testing.assert_allclose(one.modes[0], whole.modes[0])


def _guess(network, expressions):
    hidden = expressions @ network.w1 + network.b1
    return np.where(hidden > 0, hidden, 0.02 * hidden) @ network.w2 + network.b2


def test_expressions_tell_the_coefficients_of_what_they_move():
    expressions, motion = _recording()
    values = principal(LANDMARKS, motion, 2).coefficients(motion)
    network = told(expressions, values, np.array([3.0, 1.0]))
    assert network.w1.shape == (4, 64) and network.w2.shape == (64, 2)
    errors = _guess(network, expressions) - values
    assert np.sqrt(np.square(errors).mean()) < 0.25  # of 1: each value has noise of .3
    deaf = told(expressions[::-1], values, np.ones(2))  # of other frames
    assert np.sqrt(np.square(_guess(deaf, expressions) - values).mean()) > 0.8


def test_frames_without_landmarks_do_not_count():
    motion = _recording()[1]
    known = principal(LANDMARKS, motion[::2], 2)
    motion[1::2] = np.nan
    found = principal(LANDMARKS, motion, 2)
    np.testing.assert_allclose(found.modes, known.modes)
    assert np.isnan(found.coefficients(motion)[1::2]).all()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda motion: motion[: LEAST_FRAMES - 1],
        lambda motion: motion * np.nan,
        lambda motion: motion * 0,
    ],
    ids=["few frames", "nothing known", "nothing moves"],
)
def test_nothing_moves_where_nothing_is_known_to(spoil):
    assert principal(LANDMARKS, spoil(_recording()[1]), 6) is None


def test_skin_goes_with_the_landmark_that_it_is_at_and_far_away_stays():
    found = Displacement(LANDMARKS, MODES, NOTHING)
    spread = found.spread(np.concatenate([LANDMARKS, [[0.0, 3.0, 0.0]]]))
    assert spread.shape == (2, 4, 3)
    size = np.abs(MODES[:, :, :]).max()
    np.testing.assert_allclose(spread[:, 2], MODES[:, 2], atol=0.02 * size)
    assert np.abs(spread[:, 3]).max() < 1e-6 * size


def test_between_two_landmarks_skin_moves_by_their_mean():
    modes = np.zeros((1, 3, 3))
    modes[0, 0], modes[0, 1] = (0, -0.004, 0), (0, -0.002, 0)
    (middle,) = Displacement(LANDMARKS, modes, NOTHING).spread(np.array([[0.005, 0.0, 0.0]]))[0]
    less = 1 + (0.5 / 1.5) ** 4
    np.testing.assert_allclose(middle, (0, -0.003 / less, 0), rtol=1e-2, atol=1e-9)


def test_skin_at_a_distance_of_1_5_reaches_moves_half_as_far():
    alone = Displacement(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.ones((1, 2, 3)), NOTHING)
    (half,) = alone.spread(np.array([[0.0, 1.5 * 0.016, 0.0]]))[0]
    np.testing.assert_allclose(half, 0.5, rtol=1e-6)
