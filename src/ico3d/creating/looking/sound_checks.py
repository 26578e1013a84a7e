"""What the sound of a video tells: absent, silent, clipped, quiet, noisy."""

from collections.abc import Iterator

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.creating.looking.advice import Advice, spans_of

WINDOW = 0.1
"""Seconds of a piece of sound."""
BLOCK = 600
"""Number of pieces that are looked at together; a whole recording would be there several times."""
CLIPPED, IN_A_ROW = 0.985, 3
"""Size of a sample, and number of such samples in a row, from which on a sound is cut off."""
SILENT, QUIET = -55.0, -38.0
"""Loudness of the louder tenth of the pieces, decibels of full scale, below which it is so."""
ABOVE_NOISE = 15.0
"""Decibels by which speech should be above what is heard between words."""


def sound_advice(sound: Sound | None) -> Iterator[Advice]:
    """What would make the sound better.

    Args:
        sound: The video's sound; None where it has none.
    """
    length = 0 if sound is None else round(WINDOW * sound.rate)
    count = 0 if sound is None else len(sound.samples) // length
    if sound is None or not count:
        yield Advice("sound-none", "refused")
        return
    pieces = sound.samples[: count * length].reshape(count, length)  # (P, n)
    loud, floor = np.quantile(loudness(pieces), [0.9, 0.1])
    if loud < SILENT:
        yield Advice("sound-silent", "refused")
        return
    clipped = [WINDOW * (place + 0.5) for place in np.flatnonzero(clips(pieces))]
    if clipped:
        yield Advice("sound-clipped", "better", {}, spans_of(clipped, 1.0))
    if loud < QUIET:
        yield Advice("sound-quiet")
    if loud - floor < ABOVE_NOISE:
        yield Advice("sound-noise")


def loudness(pieces: np.ndarray) -> np.ndarray:
    """(...) decibels of full scale of pieces of sound (..., n)."""
    # Sums in double precision without a copy of all samples in it.
    power = np.einsum("...n,...n->...", pieces, pieces, dtype=np.float64) / pieces.shape[-1]
    return 20 * np.log10(np.sqrt(power) + 1e-9)


def clips(pieces: np.ndarray) -> np.ndarray:
    """(P,) whether a piece of (P, n) has samples at the limit in a row."""
    starts = range(0, max(len(pieces), 1), BLOCK)
    return np.concatenate([_clips(pieces[start : start + BLOCK]) for start in starts])


def _clips(pieces: np.ndarray) -> np.ndarray:
    """`clips` of a few pieces."""
    at_limit = np.abs(pieces) >= CLIPPED  # (P, n)
    rows = at_limit.shape[1] - IN_A_ROW + 1
    in_a_row = np.stack([at_limit[:, i : i + rows] for i in range(IN_A_ROW)])  # (3, P, rows)
    return np.any(np.all(in_a_row, axis=0), axis=1)
