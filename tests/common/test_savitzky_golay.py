"""The filter of Savitzky and Golay is scipy's."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from ico3d.common.savitzky_golay import filtered


@pytest.mark.parametrize(("rows", "window", "degree"), [(5, 5, 3), (6, 5, 2), (40, 9, 2)])
def test_it_gives_what_scipy_does(rows, window, degree):
    values = np.random.default_rng(rows).normal(size=(rows, 3))
    found = filtered(values, window, degree)
    np.testing.assert_allclose(found, savgol_filter(values, window, degree, axis=0), atol=1e-12)
