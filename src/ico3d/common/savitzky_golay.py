"""The filter of Savitzky and Golay: at each row a polynomial is fitted to the neighbouring rows.

It is that of `scipy.signal`, whose module takes more than a second to import.
"""

import numpy as np


def filtered(values: np.ndarray, window: int, degree: int) -> np.ndarray:
    """Values (F, C) without noise; near the ends, the polynomial of the outermost window is taken.

    Args:
        values: At least `window` rows.
        window: Odd number of rows to which a polynomial is fitted.
        degree: Degree of the polynomials.
    """
    half = window // 2
    shares = np.stack([shares_of(window, place, degree) for place in range(window)])
    parts = np.lib.stride_tricks.sliding_window_view(values, window, axis=0)  # (F - w + 1, C, w)
    ends = shares[:half] @ values[:window], shares[half + 1 :] @ values[-window:]
    return np.concatenate([ends[0], parts @ shares[half], ends[1]])


def shares_of(window: int, place: int, degree: int) -> np.ndarray:
    """(window,) what each row contributes to the polynomial through all of them at one place."""
    times = np.arange(window) - place
    return np.linalg.pinv(np.vander(times, degree + 1, increasing=True))[0]
