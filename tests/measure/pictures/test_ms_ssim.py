"""MS-SSIM against its formula, written out window by window in float64."""

import numpy as np
import pytest

from ico3d.measure.pictures.ms_ssim import ms_ssim


def _by_definition(a, b) -> float:
    steps = np.arange(11) - 5
    window = np.exp(-(steps[:, None] ** 2 + steps**2) / (2 * 1.5**2))
    window /= window.sum()

    def mean(values):
        windows = np.lib.stride_tricks.sliding_window_view(values, (11, 11))
        return np.einsum("ijkl,kl->ij", windows, window)

    found = []
    for channel in range(3):
        x, y = a[..., channel].astype(np.float64), b[..., channel].astype(np.float64)
        total = 1.0
        for scale, exponent in enumerate((0.0448, 0.2856, 0.3001, 0.2363, 0.1333)):
            mx, my = mean(x), mean(y)
            vx, vy, vxy = mean(x * x) - mx**2, mean(y * y) - my**2, mean(x * y) - mx * my
            index = (2 * vxy + 0.0009) / (vx + vy + 0.0009)
            if scale == 4:
                index = index * (2 * mx * my + 0.0001) / (mx**2 + my**2 + 0.0001)
            total *= index.mean() ** exponent
            height, width = (side // 2 * 2 for side in x.shape)
            x, y = (
                v[:height, :width].reshape(height // 2, 2, width // 2, 2).mean((1, 3))
                for v in (x, y)
            )
        found.append(total)
    return float(np.mean(found))


def test_it_is_what_it_is_defined_as():
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:177, :190]
    truth = np.stack([np.sin(rows / k) * np.cos(columns / 9) for k in (5, 11, 23)], -1) / 2 + 0.5
    noisy = np.clip(truth + 0.1 * rng.standard_normal(truth.shape), 0, 1)
    expected = _by_definition(noisy, truth)
    assert 0.5 < expected < 0.95
    assert ms_ssim(noisy, truth) == pytest.approx(expected, abs=1e-4)
    assert ms_ssim(truth, truth) == pytest.approx(1, abs=1e-6)


def test_flat_pictures_differ_by_luminance_at_the_coarsest_scale_alone():
    truth = np.full((176, 176, 3), 0.5)
    luminance = (2 * 0.5 * 0.8 + 1e-4) / (0.25 + 0.64 + 1e-4)
    assert ms_ssim(truth + 0.3, truth) == pytest.approx(luminance**0.1333, abs=1e-4)


def test_a_picture_that_holds_no_window_at_the_coarsest_scale_is_not_measured():
    assert ms_ssim(np.zeros((175, 300, 3)), np.zeros((175, 300, 3))) is None
