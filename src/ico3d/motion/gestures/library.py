"""The gestures of the package, made for one person."""

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
    """A clip of a script, for one person.

    Args:
        person: Who makes it.
        name: What it is called.
        script: What is to be done.
        hung: (R, 4) by role, of the person with hanging arms (`hanging`).
        tolerance: Degrees that a curve may be off.
    """
    poses, roles = solve(person, script, hung)
    marks = Marks(script.ready, script.stroke, *script.hold, script.end)
    return clip_of(name, marks, np.arange(len(poses)) / RATE, poses, roles, tolerance)


def library(
    person: Person, names: tuple[str, ...] = tuple(SCRIPTS), hung: Array | None = None
) -> dict[str, Clip]:
    """The gestures of the package by name; those of one hand are made with the right one.

    Args:
        person: Who makes them.
        names: Which.
        hung: (R, 4) by role, how arms hang before and after; by default as `hanging` has them.
    """
    hung = hanging(person) if hung is None else hung
    return {name: gesture(person, name, SCRIPTS[name], hung) for name in names}
