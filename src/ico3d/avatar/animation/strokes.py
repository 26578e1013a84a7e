"""Draws each gesture of a person on a skeleton at the moment of its stroke."""

from collections.abc import Iterator

import numpy as np

from ico3d.avatar.poseable import Poseable
from ico3d.motion.composing.cues import Cue
from ico3d.motion.composing.performer import Performer
from ico3d.splat.gaussians import Gaussians

SEEN = 0.1
"""Opacity above which a Gaussian counts for the space a person fills."""


def strokes(person: Poseable, expression: np.ndarray) -> Iterator[tuple[str, Gaussians]]:
    """Draws a person at the stroke of each gesture.

    Args:
        person: Who makes the gestures.
        expression: (B,) expression of the face.

    Yields:
        Name of the gesture, and the person's Gaussians in the world.
    """
    for name, clip in person.clips.items():
        performer: Performer = person.performer(0)
        stroke = clip.marks.stroke
        performer.follow([Cue(0, name, False, 0.0, stroke)])
        by_role, root = performer.at(np.array([stroke]))  # (1, R, 4), (1, 3)
        yield name, person.gaussians(by_role[0], root[0], expression)


def filled(person: Poseable, expression: np.ndarray) -> np.ndarray:
    """(P, 3) float64 positions of a person's visible Gaussians at the strokes of all gestures.

    Without gestures P is 0.

    Args:
        person: Who makes the gestures.
        expression: (B,) expression of the face.
    """
    places = [np.zeros((0, 3))]
    for _, drawn in strokes(person, expression):
        places.append(drawn.means[drawn.opacities > SEEN].cpu().numpy())
    return np.concatenate(places).astype(np.float64)
