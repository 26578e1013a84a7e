"""How one light differs from another on a surface, fitted to pixels.

A change of light is, for each colour channel, a gain and a shading: harmonics of degree 0, 1 and 2
of the surface's normal, which hold nearly all that a matt surface answers to (Ramamoorthi and
Hanrahan, "An efficient representation for irradiance environment maps"). Their sum is added to the
logit of a display colour, as a factor of light is on a film that runs softly into black and white.
Few pixels suffice for 27 numbers, and no blotch can be written with them.
"""

import numpy as np

DEGREES = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])
"""Degree of each of the nine harmonics."""
PRIOR = 4e-6
"""Weight of the prior, relative to a mean over pixels of squared differences in [0, 1].

It grows with degree l as (l·(l + 1))²: what pixels do not tell is an even gain. Where there is no
pixel the light stays as it is.
"""
EVEN = 0.1
"""Strength of the prior of the gain, in the unit of (l·(l + 1))²."""
LEAST_SPREAD = 0.01
"""Differences of colour up to which pixels never count as outliers."""


def no_change() -> np.ndarray:
    """(9, 3) coefficients of light that stays as it is."""
    return np.zeros((len(DEGREES), 3))


def improved(
    change: np.ndarray, drawn: np.ndarray, seen: np.ndarray, basis: np.ndarray, weight: np.ndarray
) -> np.ndarray:
    """One Gauss–Newton step with Huber's weights.

    Args:
        change: (9, 3) coefficients so far.
        drawn: (P, 3) colours of pixels as drawn with them, display values.
        seen: (P, 3) colours as recorded.
        basis: (P, 9) harmonics of the normals in each pixel, times what the head covers of it.
        weight: (P,) weights of the pixels, at least 0.

    Returns:
        (9, 3) better coefficients.
    """
    left = DEGREES * (DEGREES + 1.0)  # (9,)
    prior = PRIOR * np.where(DEGREES == 0, EVEN, left**2)  # (9,)
    better = change.copy()
    total = max(float(weight.sum()), 1e-12)
    for channel in range(3):
        colors = drawn[:, channel].clip(0, 1)  # (P,)
        away = seen[:, channel] - drawn[:, channel]  # (P,)
        slope = (colors * (1 - colors))[:, None] * basis  # (P, 9)
        share = (weight * _trust(away, weight) / total)[:, None]  # (P, 1)
        matrix = slope.T @ (share * slope) + np.diag(prior)  # (9, 9)
        pull = slope.T @ (share[:, 0] * away) - prior * change[:, channel]  # (9,)
        better[:, channel] += np.linalg.solve(matrix, pull)
    return better


def bounds(change: np.ndarray, basis: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(2, 3) least and largest change of logits that pixels show; arguments as for `improved`."""
    shown = basis[weight > 0] @ change  # (P', 3)
    if not len(shown):
        return np.zeros((2, 3))
    return np.percentile(shown, (1, 99), axis=0)


def _trust(away: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(P,) Huber's weights of differences (P,), whose spread is told by their median."""
    sizes = np.abs(away)
    counted = sizes[weight > 0]
    spread = 1.4826 * float(np.median(counted)) if len(counted) else 0.0
    reach = 1.345 * max(spread, LEAST_SPREAD)
    return reach / np.maximum(sizes, reach)
