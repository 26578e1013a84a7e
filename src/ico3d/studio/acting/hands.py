"""Poses of a synthetic person's hands, and the paths between them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Hand:
    """A pose of the left hand; the right hand mirrors it.

    Attributes:
        wrist: Wrist relative to the shoulder in metres: outwards, upwards, forwards.
        elbow: Direction in which the elbow points, in the axes of `wrist`.
        palm: Rotation of the forearm that turns the palm upwards, degrees.
        flexed: Bend of the wrist towards the palm, degrees.
        curled: Bend of each finger joint, degrees.
    """

    wrist: tuple[float, float, float]
    elbow: tuple[float, float, float]
    palm: float = 0.0
    flexed: float = 0.0
    curled: float = 14.0

    def row(self) -> np.ndarray:
        """The pose as (9,) numbers that can be interpolated."""
        angles = np.radians([self.palm, self.flexed, self.curled])
        return np.array([*self.wrist, *self.elbow, *angles])


DOWN = Hand((0.058, -0.502, 0.03), (0.3, 0.0, -1.0), palm=-28.0, curled=20.0)
CHEST = Hand((-0.07, -0.17, 0.25), (0.8, -0.7, -0.1), palm=-25.0, flexed=12.0, curled=16.0)
PLACES = (
    CHEST,
    Hand((0.06, -0.22, 0.36), (0.5, -0.9, -0.3), palm=-35.0, curled=6.0),
    Hand((0.14, -0.26, 0.33), (0.5, -0.8, -0.4), palm=-70.0, curled=4.0),
    Hand((0.02, -0.12, 0.37), (0.6, -0.9, -0.2), palm=15.0, flexed=-10.0, curled=20.0),
    Hand((0.10, -0.10, 0.34), (0.6, -0.8, -0.3), palm=-20.0, curled=28.0),
)
"""Poses of the hands during speech."""
RAISED = (
    Hand((0.05, 0.42, 0.13), (0.9, -0.1, 0.35), palm=10.0, curled=5.0),
    Hand((0.12, 0.40, 0.16), (0.9, -0.1, 0.35), palm=-10.0, curled=8.0),
)
READY = Hand((0.06, -0.25, 0.31), (0.6, -0.8, -0.3), palm=-25.0, curled=12.0)
"""Pose of a hand before and after it is raised above the head."""


class Track:
    """Movement of one hand: poses at key times, and minimum-jerk interpolation between them."""

    def __init__(self):
        """Starts with the hand hanging down at time 0."""
        self.times, self.rows = [0.0], [DOWN.row()]

    def hold(self, until: float) -> None:
        """Keeps the pose until time `until` in seconds."""
        self.times.append(max(until, self.times[-1]))
        self.rows.append(self.rows[-1])

    def go(self, hand: Hand, seconds: float, jitter: np.ndarray | None = None) -> None:
        """Moves to a pose within `seconds`; `jitter` (3,) displaces the wrist, metres."""
        row = hand.row()
        if jitter is not None:
            row[:3] += jitter
        self.times.append(self.times[-1] + seconds)
        self.rows.append(row)

    @property
    def now(self) -> float:
        """Time of the last key in seconds."""
        return self.times[-1]

    def at(self, times: np.ndarray) -> np.ndarray:
        """(F, 9) poses at times (F,) in seconds, as `Hand.row` writes them."""
        return minimum_jerk(np.array(self.times), np.stack(self.rows), times)


def minimum_jerk(keys: np.ndarray, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(F, N) rows at (F,) seconds, from one of the rows (K, N) at (K,) seconds to the next."""
    after = np.clip(np.searchsorted(keys, times, side="right"), 1, len(keys) - 1)
    span = np.maximum(keys[after] - keys[after - 1], 1e-9)
    part = np.clip((times - keys[after - 1]) / span, 0, 1)[:, None]
    part = part**3 * (10 - 15 * part + 6 * part**2)
    return rows[after - 1] + part * (rows[after] - rows[after - 1])
