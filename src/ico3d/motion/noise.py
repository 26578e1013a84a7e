"""Chance that is a function: the same for the same numbers, in every language.

Everything random comes from a hash of 32-bit integers; what varies over time is a sum of sines
whose periods have no common multiple within hours, so that it never repeats.
"""

import math

import numpy as np

from ico3d.rig.quaternions import Array

_WORD = 0xFFFFFFFF
RATIOS = (1.0, 0.618034, 0.414214)
"""Frequencies of the sines, next to the first: no two are multiples."""
WEIGHTS = (0.5, 0.3, 0.2)


def scrambled(*numbers: int) -> int:
    """A hash, 0 to 2³² − 1, of whole numbers below 2³², in their order."""
    state = 0x9E3779B9
    for number in numbers:
        state = (state ^ (number & _WORD)) & _WORD
        state = ((state ^ (state >> 16)) * 0x7FEB352D) & _WORD
        state = ((state ^ (state >> 15)) * 0x846CA68B) & _WORD
        state ^= state >> 16
    return state


def chance(*numbers: int) -> float:
    """0 ≤ x < 1 by the hash of whole numbers."""
    return scrambled(*numbers) / 4294967296.0


def wander(times: Array | float, period: float, seed: int, channel: int) -> Array:
    """(...) in −1 … 1 at seconds (...): slow, smooth, never the same twice.

    Args:
        times: Seconds.
        period: Of the quickest of its sines, seconds.
        seed: Whose.
        channel: Tells apart what one person does.
    """
    times = np.asarray(times, float)
    found = np.zeros_like(times)
    for number, (ratio, weight) in enumerate(zip(RATIOS, WEIGHTS, strict=True)):
        phase = 2 * math.pi * chance(seed, channel, number)
        stretch = 0.9 + 0.2 * chance(seed, channel, number, 1)
        found = found + weight * np.sin(2 * math.pi * ratio * stretch / period * times + phase)
    return found
