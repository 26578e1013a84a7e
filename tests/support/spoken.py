"""Speech as composers of gestures know it: words with their times, and loudness."""

import numpy as np

from ico3d.motion.composing.accents import FRAME, Word

TEXT = (
    "hello and welcome to the garden where we have three enormous trees that nobody planted "
    "maybe you know who did it yes or no the smallest flower grows beside the second fountain"
)


def speech(seed: int) -> tuple[tuple[Word, ...], np.ndarray]:
    """Words of random lengths, each with one peak of random loudness."""
    rng = np.random.default_rng(seed)
    words, now, level = [], 0.3, []
    for text in TEXT.split():
        length = float(rng.uniform(0.15, 0.5))
        words.append(Word(text, now, now + length))
        level.append((now + length / 2, float(rng.uniform(-16, 0)), length))
        now += length + float(rng.choice([0.02, 0.02, 0.4]))
    times = np.arange(0, now + 0.3, FRAME)
    bumps = [loud - 25 * np.abs(times - at) / length for at, loud, length in level]
    return tuple(words), np.maximum(np.max(bumps, 0), -70.0)
