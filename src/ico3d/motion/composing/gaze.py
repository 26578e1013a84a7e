"""Turning to the visitor: the head first, then the chest, as far and as fast as people do."""

import math
from dataclasses import dataclass

import numpy as np

from ico3d.motion.turning import about
from ico3d.rig.quaternions import Array, multiply

TICK = 0.01
"""Seconds of a step: whatever asks, motion is the same."""
HEAD_YAW, HEAD_PITCH = math.radians(50.0), math.radians(22.0)
"""How far neck and head turn against the chest, and nod."""
CHEST_YAW = math.radians(24.0)
"""How far the chest turns."""
CHEST_FROM, CHEST_PART = math.radians(15.0), 0.4
"""From which angle on the chest turns too, and what part of what is beyond."""
HEAD_SPEED, CHEST_SPEED = math.radians(140.0), math.radians(45.0)
"""Radians a second, at most."""
HEAD_STIFF, CHEST_STIFF = 7.0, 3.0
"""1/s: how soon they follow (critically damped)."""
BEHIND = math.radians(120.0)
"""From which angle on a visitor is behind, who is looked after on the side where they went."""


@dataclass
class _Hinge:
    """An angle that follows a target, critically damped, no faster than a limit."""

    stiff: float
    fastest: float
    angle: float = 0.0
    speed: float = 0.0

    def step(self, target: float) -> None:
        pull = self.stiff * self.stiff * (target - self.angle) - 2 * self.stiff * self.speed
        most = self.stiff * self.fastest
        self.speed += TICK * min(max(pull, -most), most)
        self.speed = min(max(self.speed, -self.fastest), self.fastest)
        self.angle += TICK * self.speed


class Gaze:
    """Where chest and head are turned; goes on in steps of `TICK`."""

    def __init__(self):
        """Looks straight ahead at 0 s."""
        self._steps = 0
        self._yaw, self._pitch = 0.0, 0.0
        self._chest = _Hinge(CHEST_STIFF, CHEST_SPEED)
        self._head = _Hinge(HEAD_STIFF, HEAD_SPEED)
        self._nod = _Hinge(HEAD_STIFF, HEAD_SPEED)

    def look(self, yaw: float, pitch: float) -> None:
        """The visitor is there.

        Args:
            yaw: Radians to the person's left from straight ahead.
            pitch: Radians downwards.
        """
        if abs(yaw) <= BEHIND:
            self._yaw = yaw
        else:
            self._yaw = math.copysign(BEHIND, self._yaw or yaw)
        self._pitch = pitch

    def at(self, time: float) -> Array:
        """(3, 4) turns of chest, neck and head at a time, not before the last one asked for."""
        while self._steps * TICK < time - 1e-9:
            self._step()
            self._steps += 1
        left = np.array([0.0, 1.0, 0.0])
        down = np.array([1.0, 0.0, 0.0])
        half = multiply(about(left, 0.5 * self._head.angle), about(down, 0.5 * self._nod.angle))
        return np.stack([about(left, self._chest.angle), half, half])

    def _step(self) -> None:
        beyond = max(abs(self._yaw) - CHEST_FROM, 0.0) * CHEST_PART
        wanted = math.copysign(min(beyond, CHEST_YAW), self._yaw)
        self._chest.step(wanted)
        rest = self._yaw - self._chest.angle
        self._head.step(min(max(rest, -HEAD_YAW), HEAD_YAW))
        self._nod.step(min(max(self._pitch, -HEAD_PITCH), HEAD_PITCH))


def direction_to(eyes: Array, visitor: Array) -> tuple[float, float]:
    """Yaw to the person's left and pitch downwards, radians, from eyes (3,) to a visitor (3,)."""
    x, y, z = visitor - eyes
    return math.atan2(x, z), -math.atan2(y, math.sqrt(x * x + z * z))
