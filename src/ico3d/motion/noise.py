"""Random numbers that are functions of whole numbers, equal in Python and TypeScript.

All of them come from a hash of 32-bit integers. Values that vary over time are sums of sines whose
periods have no common multiple within hours, so that they never repeat.
"""

import math

import numpy as np

from ico3d.rig.quaternions import Array

_WORD = 0xFFFFFFFF
RATIOS = (1.0, 0.618034, 0.414214)
"""Frequencies of the sines, relative to the first; none is a multiple of another."""
WEIGHTS = (0.5, 0.3, 0.2)
"""Amplitudes of the sines, with sum 1."""


def scrambled(*numbers: int) -> int:
    """A hash from 0 to 2³² − 1 of whole numbers below 2³²; their order matters."""
    state = 0x9E3779B9
    for number in numbers:
        state = (state ^ (number & _WORD)) & _WORD
        state = ((state ^ (state >> 16)) * 0x7FEB352D) & _WORD
        state = ((state ^ (state >> 15)) * 0x846CA68B) & _WORD
        state ^= state >> 16
    return state


def chance(*numbers: int) -> float:
    """A random number 0 ≤ x < 1 from the hash of whole numbers."""
    return scrambled(*numbers) / 4294967296.0


def wander(times: Array | float, period: float, seed: int, channel: int) -> Array:
    """(...) slow, smooth values between −1 and 1 that do not repeat.

    Args:
        times: (...) seconds.
        period: Period of the quickest sine, seconds; it varies by a tenth with seed and channel.
        seed: Seed of the person.
        channel: Number of the movement; different movements of a person are independent.
    """
    times = np.asarray(times, float)
    found = np.zeros_like(times)
    for number, (ratio, weight) in enumerate(zip(RATIOS, WEIGHTS, strict=True)):
        phase = 2 * math.pi * chance(seed, channel, number)
        stretch = 0.9 + 0.2 * chance(seed, channel, number, 1)
        found = found + weight * np.sin(2 * math.pi * ratio * stretch / period * times + phase)
    return found
