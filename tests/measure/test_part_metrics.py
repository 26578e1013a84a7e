"""Metrics against closed forms."""

import numpy as np
import pytest

from ico3d.common.psnr import psnr
from ico3d.measure.lips import lip_correlation, lip_gap, lip_lag_ms
from ico3d.measure.part_metrics import lmd, mouth_box, psnr_mouth


def test_psnr_of_a_constant_error():
    truth = np.full((4, 6, 3), 0.5)
    assert psnr(truth + 0.1, truth) == pytest.approx(20.0)


def test_psnr_on_a_mask_counts_only_what_it_covers():
    truth, predicted = np.zeros((4, 6, 3)), np.zeros((4, 6, 3))
    predicted[0, 0] = 0.1  # covered
    predicted[3, 3] = 1.0  # not covered
    mask = np.zeros((4, 6))
    mask[0, 0], mask[0, 1] = 1, 0.5
    expected = -10 * np.log10(3 * 0.1**2 / (3 * 1.5))
    assert psnr(predicted, truth, mask) == pytest.approx(expected)
    assert psnr(predicted, truth, np.zeros((4, 6))) is None


def _landmarks(low, high) -> np.ndarray:
    points = np.zeros((68, 2))
    points[48:] = (np.array(low) + high) / 2
    points[48], points[49] = low, high
    return points


def test_the_mouth_box_grows_by_half_and_stays_in_the_picture():
    assert mouth_box(_landmarks((10, 20), (18, 24)), 64, 64) == (slice(19, 25), slice(8, 20))
    assert mouth_box(_landmarks((0, 0), (4, 4)), 64, 64) == (slice(0, 5), slice(0, 5))
    assert mouth_box(_landmarks((90, 20), (98, 24)), 64, 64) is None


def test_psnr_mouth_sees_only_the_mouth():
    truth, landmarks = np.zeros((64, 64, 3)), _landmarks((10, 20), (18, 24))
    predicted = np.ones((64, 64, 3))
    predicted[19:25, 8:20] = 0.1
    assert psnr_mouth(predicted, truth, landmarks) == pytest.approx(20.0)


def test_lmd_ignores_where_the_mouth_is():
    rng = np.random.default_rng(0)
    truth = rng.random((68, 2)) * 50
    assert lmd(truth + np.array([3, -7]), truth) == pytest.approx(0)
    opened = truth.copy()
    opened[48:58, 1] += 1.0
    opened[58:, 1] -= 1.0
    assert lmd(opened, truth) == pytest.approx(1.0)


def test_lip_gap_is_the_mean_distance_of_the_inner_lips():
    points = np.zeros((68, 2))
    points[[65, 66, 67], 1] = (3.0, 4.0, 5.0)
    assert lip_gap(points) == pytest.approx(4.0)


def _speech(times: np.ndarray) -> np.ndarray:
    return np.sin(times * 7) + 0.5 * np.sin(times * 17 + 1) + 0.3 * np.sin(times * 29)


@pytest.mark.parametrize("lag_ms", [-90.0, -25.0, 0.0, 10.0, 60.0])
def test_the_lag_is_found_between_frames(lag_ms):
    times = np.arange(200) / 25
    late = 3 * _speech(times - lag_ms / 1000) + 1
    assert lip_lag_ms(late, _speech(times), 25) == pytest.approx(lag_ms, abs=4)


def test_correlation_leaves_out_unseen_frames_and_refuses_constants():
    truth = _speech(np.arange(50) / 25)
    seen = truth * 2 + 1
    seen[7] = np.nan
    assert lip_correlation(seen, truth) == pytest.approx(1.0)
    assert lip_correlation(np.ones(50), truth) is None
    assert lip_lag_ms(np.ones(50), truth, 25) is None
