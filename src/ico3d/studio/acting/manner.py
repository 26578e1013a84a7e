"""How a face is while it speaks and rests: as it is, or glad to see somebody, at times more so."""

from dataclasses import replace

import numpy as np

from ico3d.studio.acting.performance import SOUND_RATE, Performance, wander
from ico3d.studio.person.subject import Subject

GLAD: dict[str, float] = {
    "mouthSmileLeft": 0.32,
    "mouthSmileRight": 0.32,
    "cheekSquintLeft": 0.22,
    "cheekSquintRight": 0.22,
    "mouthDimpleLeft": 0.08,
    "mouthDimpleRight": 0.08,
    "eyeSquintLeft": 0.1,
    "eyeSquintRight": 0.1,
}
"""Weights of blendshapes that make a slight smile."""
MANNERS: dict[str, tuple[float, float]] = {
    "neutral": (0.0, 0.0),
    "friendly": (1.0, 1.0),
    "smiling": (0.15, 1.6),
}
"""Least and most of `GLAD` that stays all the time, whatever else the face does."""
SLOWLY = 0.25
"""Highest frequency in Hz with which a smile comes and goes: a word lasts less than that."""


def mannered(subject: Subject, acted: Performance, manner: str, seed: int = 0) -> Performance:
    """The performance with the smile of a manner added in every frame.

    Args:
        subject: The person; blendshapes that they lack are left out.
        acted: The performance.
        manner: One of `MANNERS`.
        seed: Decides when a smile that is not always the same comes and goes.
    """
    least, most = MANNERS[manner]
    if not most:
        return acted
    frames = len(acted.weights)
    times = np.arange(frames) * len(acted.samples) / SOUND_RATE / frames
    share = 0.5 + 0.5 * np.clip(
        1.5 * wander(times, SLOWLY, np.random.default_rng([seed, 5])), -1, 1
    )
    smile = least + (most - least) * share  # (F,)
    added = smile[:, None] * subject.weights(GLAD)  # (F, K)
    return replace(acted, weights=np.clip(acted.weights + added, 0, 1).astype(np.float32))
