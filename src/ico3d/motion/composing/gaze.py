"""Turns a person to the visitor: the head first, then the chest, as far and fast as people do."""

import math
from dataclasses import dataclass

import numpy as np

from ico3d.motion.turning import about
from ico3d.rig.quaternions import Array, multiply

TICK = 0.01
"""Seconds of a simulation step; steps are fixed, so motion does not depend on the caller's rate."""
HEAD_YAW, HEAD_PITCH = math.radians(50.0), math.radians(22.0)
"""Largest angles in radians by which neck and head together turn and nod against the chest."""
CHEST_YAW = math.radians(24.0)
"""Largest angle in radians by which the chest turns."""
CHEST_FROM, CHEST_PART = math.radians(15.0), 0.4
"""Angle of the visitor in radians above which the chest turns, and its share of the rest."""
FACE_SPEED, CHEST_SPEED = math.radians(140.0), math.radians(45.0)
"""Largest angular speeds of face and chest in space, radians per second."""
FACE_STIFF, CHEST_STIFF = 7.0, 3.0
"""Natural frequencies, in 1/s, with which face and chest follow, critically damped."""
BEHIND = math.radians(120.0)
"""Angle in radians above which a visitor is behind the person.

The person then keeps looking to the side on which the visitor went out of sight.
"""


@dataclass
class _Hinge:
    """An angle that follows a target, critically damped and with limited speed.

    Attributes:
        stiff: Natural frequency, 1/s.
        fastest: Largest speed, radians per second.
        angle: Radians.
        speed: Radians per second.
    """

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
    """Rotations of chest, neck and head towards a visitor, simulated in steps of `TICK`."""

    def __init__(self):
        """Begins at 0 s, looking straight ahead."""
        self._steps = 0
        self._yaw, self._pitch = 0.0, 0.0
        self._chest = _Hinge(CHEST_STIFF, CHEST_SPEED)
        self._face = _Hinge(FACE_STIFF, FACE_SPEED)
        self._nod = _Hinge(FACE_STIFF, FACE_SPEED)

    def look(self, yaw: float, pitch: float) -> None:
        """Sets the direction of the visitor, see `direction_to`.

        Args:
            yaw: Angle to the person's left from straight ahead, radians.
            pitch: Angle downwards, radians.
        """
        if abs(yaw) <= BEHIND:
            self._yaw = yaw
        else:
            self._yaw = math.copysign(BEHIND, self._yaw or yaw)
        self._pitch = pitch

    def at(self, time: float) -> Array:
        """(3, 4) local rotations of chest, neck and head at a time in seconds.

        Times must not descend from call to call.
        """
        while self._steps * TICK < time - 1e-9:
            self._step()
            self._steps += 1
        left = np.array([0.0, 1.0, 0.0])
        down = np.array([1.0, 0.0, 0.0])
        turned = self._face.angle - self._chest.angle
        half = multiply(about(left, 0.5 * turned), about(down, 0.5 * self._nod.angle))
        return np.stack([about(left, self._chest.angle), half, half])

    def _step(self) -> None:
        beyond = max(abs(self._yaw) - CHEST_FROM, 0.0) * CHEST_PART
        wanted = math.copysign(min(beyond, CHEST_YAW), self._yaw)
        self._chest.step(wanted)
        # The face, not the neck, follows: it stays on the visitor while the chest catches up.
        rest = self._yaw - self._chest.angle
        self._face.step(self._chest.angle + min(max(rest, -HEAD_YAW), HEAD_YAW))
        self._nod.step(min(max(self._pitch, -HEAD_PITCH), HEAD_PITCH))


def direction_to(point: Array, visitor: Array) -> tuple[float, float]:
    """Yaw to the left and pitch downwards, radians, of a visitor as seen by a person facing +z.

    Args:
        point: (3,) point at the height of the person's eyes, over the neck about which the face
            turns, metres.
        visitor: (3,) position of the visitor in the same space, metres.
    """
    x, y, z = visitor - point
    return math.atan2(x, z), -math.atan2(y, math.sqrt(x * x + z * z))
