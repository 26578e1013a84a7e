"""Makes the gestures of the package for one person."""

import numpy as np

from ico3d.motion.clip import Clip, Marks, clip_of
from ico3d.motion.curves import TOLERANCE
from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.gestures.script import Script
from ico3d.motion.gestures.scripts import SCRIPTS
from ico3d.motion.gestures.solve import RATE, solve
from ico3d.motion.person import Person
from ico3d.rig.quaternions import Array


def gesture(
    person: Person, name: str, script: Script, hung: Array, tolerance: float = TOLERANCE
) -> Clip:
    """Makes a clip from a script, for one person.

    Args:
        person: Who makes the gesture.
        name: Name of the gesture.
        script: The gesture.
        hung: (R, 4) pose by role with hanging arms (`hanging`).
        tolerance: Largest error of the curves, degrees.
    """
    poses, roles = solve(person, script, hung)
    marks = Marks(script.ready, script.stroke, *script.hold, script.end)
    return clip_of(name, marks, np.arange(len(poses)) / RATE, poses, roles, tolerance)


def library(
    person: Person, names: tuple[str, ...] = tuple(SCRIPTS), hung: Array | None = None
) -> dict[str, Clip]:
    """Makes gestures of the package; where a name says no hand, one hand means the right one.

    Args:
        person: Who makes the gestures.
        names: Names of the gestures, keys of `SCRIPTS`.
        hung: (R, 4) pose by role with hanging arms, before and after; by default that of `hanging`.

    Returns:
        Clips by name.
    """
    hung = hanging(person) if hung is None else hung
    return {name: gesture(person, name, SCRIPTS[name], hung) for name in names}
