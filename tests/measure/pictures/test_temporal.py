"""Temporal flicker against closed forms."""

import numpy as np
import pytest

from ico3d.measure.pictures.temporal import TemporalFlicker, flicker


def test_a_constant_error_is_no_flicker_and_a_still_picture_lacks_the_movement():
    truth = np.full((2, 4, 6, 3), 0.5)
    truth[1, 0, 0] = 0.8
    assert flicker((truth[0] + 0.1, truth[1] + 0.1), (truth[0], truth[1])) == pytest.approx(0)
    still = flicker((truth[0], truth[0]), (truth[0], truth[1]))
    assert still == pytest.approx(0.3 / 24)


def test_noise_flickers_by_its_deviation():
    truth = np.full((80, 80, 3), 0.5)
    noise = 0.02 * np.random.default_rng(0).standard_normal((2, 80, 80, 3))
    found = flicker((truth + noise[0], truth + noise[1]), (truth, truth))
    assert found == pytest.approx(0.02 * 2 / np.sqrt(np.pi), rel=0.02)


def test_pairs_are_consecutive_frames_of_one_camera_on_the_person():
    black, measured = np.zeros((2, 2, 3)), TemporalFlicker()
    lit = black.copy()
    lit[0, 0], lit[1, 1] = 0.4, 1.0
    first, second = np.zeros((2, 2)), np.zeros((2, 2))
    first[0, 0], second[0, 1] = 1.0, 0.5
    assert measured.add("a", 1, black, black, first) is None
    assert measured.add("b", 2, lit, black, second) is None  # another camera
    assert measured.add("a", 2, lit, black, second) == pytest.approx(0.4 / 1.5)
    assert measured.add("a", 4, lit, black, second) is None  # frame 3 is missing
    assert measured.add("b", 3, lit, black, np.zeros((2, 2))) == pytest.approx(0)
    assert measured.mean() == pytest.approx(0.4 / 1.5 / 2)
    assert TemporalFlicker().mean() is None
