"""How a face is while it speaks and rests: as it is, or glad to see somebody, at times more so."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ico3d.studio.acting.articulation import closure
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
BEAMING: dict[str, float] = {
    "mouthSmileLeft": 0.3,
    "mouthSmileRight": 0.3,
    "cheekSquintLeft": 0.36,
    "cheekSquintRight": 0.36,
    "mouthDimpleLeft": 0.06,
    "mouthDimpleRight": 0.06,
    "eyeSquintLeft": 0.24,
    "eyeSquintRight": 0.24,
}
"""Weights of a smile in which cheeks and lids take as much part as the mouth."""
PARTED: dict[str, float] = {
    "mouthUpperUpLeft": 0.2,
    "mouthUpperUpRight": 0.2,
    "mouthLowerDownLeft": 0.1,
    "mouthLowerDownRight": 0.1,
    "jawOpen": 0.05,
}
"""Weights by which a wide smile shows the teeth."""


@dataclass(frozen=True)
class Manner:
    """A smile that stays all the time, whatever else the face does.

    Attributes:
        least: Least of `smile` that is added.
        most: Most of it; between both it comes and goes.
        smile: Weights of blendshapes.
        parted: Weights that part the lips in the upper half of the smile: all of them at `most`,
            none while a sound closes the lips.
    """

    least: float
    most: float
    smile: Mapping[str, float] = field(default_factory=lambda: GLAD)
    parted: Mapping[str, float] = field(default_factory=dict)


MANNERS: dict[str, Manner] = {
    "neutral": Manner(0.0, 0.0),
    "friendly": Manner(1.0, 1.0),
    "smiling": Manner(0.15, 1.6),
    "beaming": Manner(0.15, 1.6, BEAMING, PARTED),
}
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
    how = MANNERS[manner]
    if not how.most:
        return acted
    frames = len(acted.weights)
    seconds = len(acted.samples) / SOUND_RATE
    times = np.arange(frames) * seconds / frames
    share = 0.5 + 0.5 * np.clip(
        1.5 * wander(times, SLOWLY, np.random.default_rng([seed, 5])), -1, 1
    )
    smile = how.least + (how.most - how.least) * share  # (F,)
    wide = np.clip(2 * share - 1, 0, 1) * (1 - closure(acted.phonemes, seconds, times))  # (F,)
    added = smile[:, None] * subject.weights(dict(how.smile))  # (F, K)
    added = added + wide[:, None] * subject.weights(dict(how.parted))
    return replace(acted, weights=np.clip(acted.weights + added, 0, 1).astype(np.float32))
