"""The gestures that somebody on a skeleton makes without a recording, each at its stroke."""

from collections.abc import Iterator

import numpy as np

from ico3d.avatar.poseable import Poseable
from ico3d.motion.composing.cues import Cue
from ico3d.motion.composing.performer import Performer
from ico3d.splat.gaussians import Gaussians

SEEN = 0.1
"""Opacity from which a Gaussian counts for where the person is."""


def strokes(person: Poseable, expression: np.ndarray) -> Iterator[tuple[str, Gaussians]]:
    """Names of gestures, and the person at the moment when the stroke arrives.

    Args:
        person: Who makes them.
        expression: (B,) of the face meanwhile.
    """
    for name, clip in person.clips.items():
        performer: Performer = person.performer(0)
        stroke = clip.marks.stroke
        performer.follow([Cue(0, name, False, 0.0, stroke)])
        by_role, root = performer.at(np.array([stroke]))  # (1, R, 4), (1, 3)
        yield name, person.gaussians(by_role[0], root[0], expression)


def filled(person: Poseable, expression: np.ndarray) -> np.ndarray:
    """(P, 3) places that somebody fills at the strokes of all gestures."""
    places = []
    for _, drawn in strokes(person, expression):
        places.append(drawn.means[drawn.opacities > SEEN].cpu().numpy())
    return np.concatenate(places).astype(np.float64)
