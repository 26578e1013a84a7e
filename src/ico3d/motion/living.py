"""The living rest: a standing person breathes, shifts their weight and is never quite still."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.noise import wander
from ico3d.motion.person import Person, person_of
from ico3d.motion.retarget import DOWN, HINGE
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.standing import Stance, stance_of
from ico3d.motion.turning import about
from ico3d.rig.quaternions import Array, from_rotvec, multiply
from ico3d.rig.rig import Rig

Turn = tuple[float, float, float]
"""Degrees about x, y and z."""
BREATH = 4.1
"""Duration of a breath in seconds: 15 per minute, as of people at rest."""
WEIGHT = 9.7
"""Period in seconds of the quickest of the sines that shift the weight."""
SHIFT = 0.02
"""Displacement of the hips to each side, relative to `Person.height`."""
DROP = 0.0075
"""How far the hips sink when the weight is on one leg, relative to height."""
SWAY = 0.003
"""Displacement of the hips forwards and back, relative to height."""
_BREATHING = np.radians((-1.1, 0.9, 1.0))
"""Angles in radians by which a breath turns chest, head and collarbones."""


@dataclass(frozen=True, eq=False)
class Living:
    """A person at rest.

    Attributes:
        person: Who it is.
        stance: Where the feet stand.
        hung: (R, 4) pose by role with hanging arms, wxyz.
        seed: Seed of all random movements.
    """

    person: Person
    stance: Stance
    hung: Array
    seed: int

    def at(self, times: Array | float) -> tuple[Array, Array]:
        """Poses of the person at rest at times (...) in seconds.

        Returns:
            (..., R, 4) local rotations by role, wxyz, and (..., 3) translation of the root from
            rest, metres.
        """
        times = np.asarray(times, float)
        pose = np.broadcast_to(self.hung, (*times.shape, *self.hung.shape)).copy()
        breath = self.breath(times)
        weight = self._wander(times, WEIGHT, 1)
        weight = 3.2 * weight / np.sqrt(1 + 9 * weight * weight)  # stays longer on one leg
        self._turn_torso(times, breath, weight, pose)
        self._swing_arms(times, breath, pose)
        height = self.person.height
        root = np.stack(
            [
                SHIFT * height * weight,
                -self.stance.sink - DROP * height * weight * weight,
                SWAY * height * self._wander(times, 5.3, 2),
            ],
            -1,
        )  # (..., 3)
        self.stance.place(root, pose)
        return pose, root

    def breath(self, times: Array) -> Array:
        """(...) state of the breath at times (...) in seconds, from −1 (out) to 1 (in)."""
        phase = 2 * np.pi * times / BREATH + 0.9 * self._wander(times, 13.1, 0)
        return np.sin(phase + 0.35 * np.sin(phase))  # breathing in is faster than out

    def _wander(self, times: Array, period: float, channel: int) -> Array:
        return wander(times, period, self.seed, channel)

    def _vector(self, times: Array, period: float, channel: int, degrees: Turn) -> Array:
        """(..., 3) random rotation vectors, with coordinates of up to these degrees."""
        rows = [self._wander(times, period, channel + i) for i in range(3)]
        return np.stack(rows, -1) * np.radians(degrees)

    def _turn_torso(self, times: Array, breath: Array, weight: Array, pose: Array) -> None:
        zero = np.zeros_like(times)
        roll = np.radians(5.0) * weight
        hips = np.stack([zero, zero, roll], -1) + self._vector(times, 12.7, 10, (0.5, 1.2, 0.2))
        spine = np.stack([zero, zero, -0.9 * roll], -1)
        chest = np.stack([_BREATHING[0] * breath, zero, -0.5 * roll], -1)
        chest = chest + self._vector(times, 8.9, 13, (0.5, 0.9, 0.4))
        head = np.stack([_BREATHING[1] * breath, zero, 0.4 * roll], -1)
        head = head + self._vector(times, 5.9, 16, (1.3, 2.2, 1.0))
        for role, turn in (("hips", hips), ("spine", spine), ("chest", chest)):
            pose[..., INDEX[role], :] = from_rotvec(turn)
        for role in ("neck", "head"):
            pose[..., INDEX[role], :] = from_rotvec(0.5 * head)

    def _swing_arms(self, times: Array, breath: Array, pose: Array) -> None:
        forward, sidewards = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
        for number, (side, sign) in enumerate(zip(SIDES, (1.0, -1.0), strict=True)):
            channel = 20 + 10 * number
            lifted = about(forward, sign * _BREATHING[2] * (0.5 + 0.5 * breath))
            pose[..., INDEX[f"{side}_clavicle"], :] = lifted
            swing = about(sidewards, np.radians(1.5) * self._wander(times, 7.3, channel))
            away = 0.5 + 0.5 * self._wander(times, 9.1, channel + 1)
            swing = multiply(about(forward, sign * np.radians(1.2) * away), swing)
            bend = about(HINGE, np.radians(3.0) * self._wander(times, 6.1, channel + 2))
            turn = about(DOWN, sign * np.radians(7.0) * self._wander(times, 8.3, channel + 3))
            for part, what in (("shoulder", swing), ("elbow", bend), ("wrist", turn)):
                row = INDEX[f"{side}_{part}"]
                pose[..., row, :] = multiply(what, pose[..., row, :])


def living(rig: Rig, seed: int, hung: Array | None = None) -> Living:
    """Makes a person at rest from a rig.

    Args:
        rig: The person's skeleton.
        seed: Seed of all random movements.
        hung: (R, 4) pose by role with hanging arms; by default they hang as near to the body as its
            width allows (`hanging`).

    Raises:
        SettingsError: If the rig lacks a role that is needed to stand or gesture.
    """
    person = person_of(rig)
    hung = hanging(person) if hung is None else hung
    return Living(person, stance_of(person), hung, seed)
