"""How a face is while it speaks and rests: as it is, or glad to see somebody."""

from dataclasses import replace

import numpy as np

from ico3d.studio.acting.performance import Performance
from ico3d.studio.person.subject import Subject

MANNERS: dict[str, dict[str, float]] = {
    "neutral": {},
    "friendly": {
        "mouthSmileLeft": 0.32,
        "mouthSmileRight": 0.32,
        "cheekSquintLeft": 0.22,
        "cheekSquintRight": 0.22,
        "mouthDimpleLeft": 0.08,
        "mouthDimpleRight": 0.08,
        "eyeSquintLeft": 0.1,
        "eyeSquintRight": 0.1,
    },
}
"""Weights of blendshapes that stay all the time, whatever else the face does."""


def mannered(subject: Subject, acted: Performance, manner: str) -> Performance:
    """The performance with the weights that belong to a manner added in every frame.

    Args:
        subject: The person; blendshapes that they lack are left out.
        acted: The performance.
        manner: One of `MANNERS`.
    """
    if not MANNERS[manner]:
        return acted
    added = subject.weights(MANNERS[manner])  # (K,)
    return replace(acted, weights=np.clip(acted.weights + added, 0, 1))
