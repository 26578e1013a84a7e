"""The template brought to what was seen by Gauss-Newton steps: from rest to any pose in thirty.

Poses of single frames, held together by their neighbours in time, and what all frames share take
turns. First-order methods need thousands of steps here, because a hip moves a whole leg and the
end of a finger nothing but itself; the normal equations know that.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed
from ico3d.capture.posing.fitting.rows import LandmarkTerm, Term
from ico3d.capture.posing.fitting.surface import Surface
from ico3d.rig.quaternions import from_matrix, from_rotvec, slerp, to_matrix, to_rotvec

LARGEST_STEP = 0.4
"""Radians by which a step turns a joint at most."""
FIRST_DAMPING, DAMPED = 0.05, 0.75
"""Damping of the first step, by what priors weigh with a spread of 1 rad; its part step by step."""
LIMIT = 0.05
"""Radians beyond where bending stops that cost as much as one standard deviation."""
PLACE_PACE = 0.008
"""Metres by which the root's step in a tenth of a second usually differs from that before."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a run of steps takes into account.

    Attributes:
        steps: How many.
        shape_from: The step from which on shape joins in.
        outlines: Whether outlines are looked at.
    """

    steps: int
    shape_from: int
    outlines: bool


class Solver:
    """Improves a body step by step."""

    def __init__(
        self,
        kinematics: Kinematics,
        landmarks: LandmarkTerm,
        surface: Surface,
        usual: tuple[np.ndarray, np.ndarray],
        frames: np.ndarray,
        fps: float,
    ):
        """Takes over what does not change.

        Args:
            kinematics: Of the template.
            landmarks: Evidence by points.
            surface: Evidence by outlines.
            usual: Offsets of landmarks (P, 3) that are usual, and (P,) metres that others differ.
            frames: (F,) numbers in the recording of the frames that are fitted.
            fps: The recording's frames per second.
        """
        self._kinematics, self._anatomy = kinematics, kinematics.anatomy
        self._landmarks, self._surface = landmarks, surface
        self._usual_offsets = usual
        middle = np.flatnonzero(frames[2:] - frames[:-2] == 2) + 1
        self._between = np.isin(np.arange(len(frames)), middle)  # (F,) has both neighbours
        tenths = (10 / fps) ** 2
        self._pace, self._root_pace = self._anatomy.pace * tenths, PLACE_PACE * tenths

    def run(self, body: Body, plan: Plan, done: Callable[[], None]) -> None:
        """Improves a body in place.

        Args:
            body: What is sought.
            plan: How.
            done: Called after each step.
        """
        terms: list[Term] = [self._landmarks, *([self._surface] if plan.outlines else [])]
        for step in range(plan.steps):
            damping = FIRST_DAMPING * DAMPED**step
            shared = _Shared(body, self._usual_offsets, self._surface.information)
            for frame in range(len(body.roots)):
                self._pose(body, frame, terms, damping)
                if step >= plan.shape_from:
                    shared.add(self._kinematics, body, frame, terms)
            if step >= plan.shape_from:
                shared.solve(body)
            done()

    def _pose(self, body: Body, frame: int, terms: Sequence[Term], damping: float) -> None:
        """One step of a frame's angles and root."""
        posed = self._kinematics.posed(body, frame)
        count = body.angles[frame].size
        normal, pull = np.zeros((count + 3, count + 3)), np.zeros(count + 3)
        for term in terms:
            rows = term.rows(body, posed, frame)
            system = posed.changes(
                rows.points, rows.ways, term.carried[rows.numbers]
            )  # (N, 3 J + 3)
            weighted = (system * rows.weights[:, None]).astype(np.float32)
            normal += weighted.T @ system.astype(np.float32)
            pull += weighted.T @ rows.missing
        strength, aim = self._prior(body, frame)
        pull += strength * (aim - np.append(body.angles[frame], body.roots[frame]))
        slow = np.append(1 / self._anatomy.spread.ravel() ** 2, [1.0] * 3)
        number = np.arange(count + 3)
        normal[number, number] += strength + damping * (slow + normal[number, number])
        step = np.linalg.solve(normal, pull)
        turn = step[:count].reshape(-1, 3)
        size = np.linalg.norm(turn, axis=-1, keepdims=True)
        body.angles[frame] += turn * np.minimum(1, LARGEST_STEP / np.maximum(size, 1e-9))
        body.roots[frame] += step[count:]

    def _prior(self, body: Body, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """1 / variance (3 J + 3,) of angles and root before anything is seen, and their means."""
        anatomy, angles = self._anatomy, body.angles[frame]
        strength, pull = 1 / anatomy.spread**2, np.zeros(angles.shape)  # (J, 3)
        bend = angles[:, 0]
        stop = np.clip(bend, anatomy.bend[:, 0], anatomy.bend[:, 1])
        beyond = np.where(stop != bend, 1 / LIMIT**2, 0.0)
        strength[:, 0] += beyond
        pull[:, 0] += beyond * stop
        root_strength, root_aim = np.full(3, 1e-6), body.roots[frame]
        if self._between[frame]:
            around = 0.5 * (body.angles[frame - 1] + body.angles[frame + 1])
            around[0] = _root_angles(body, frame)
            calm = _calm(angles - around, self._pace[:, None])
            strength, pull = strength + calm, pull + calm * around
            root_aim = 0.5 * (body.roots[frame - 1] + body.roots[frame + 1])
            root_strength = _calm(body.roots[frame] - root_aim, self._root_pace)
        return (
            np.append(strength, root_strength),
            np.append(pull / strength, root_aim),
        )


def _calm(off: np.ndarray, pace: np.ndarray | float) -> np.ndarray:
    """1 / variance of a value whose neighbours' mean is so far off (pseudo-Huber)."""
    return 4 / pace**2 / np.sqrt(1 + (2 * off / pace) ** 2)


def _root_angles(body: Body, frame: int) -> np.ndarray:
    """(3,) the root's own angles that turn it half-way between its neighbours."""
    before, after = (
        from_matrix(body.root_turns[f] @ to_matrix(from_rotvec(body.angles[f, 0])))
        for f in (frame - 1, frame + 1)
    )
    between = to_matrix(slerp(before, after, 0.5))
    return to_rotvec(from_matrix(body.root_turns[frame].T @ between))


class _Shared:
    """Normal equations of what all frames share: shape, offsets of landmarks, stand-off."""

    def __init__(self, body: Body, usual: tuple[np.ndarray, np.ndarray], information: csr_matrix):
        """Begins with priors.

        Detectors err alike in neighbouring frames, so that frames are not as many witnesses:
        priors count as often as the root of their number.
        """
        self._say = len(body.roots) ** 0.5
        self._shapes, self._information = len(body.shape), information
        offsets = body.offsets.size
        self._small = np.diag(
            self._say * np.append(np.ones(self._shapes), np.repeat(1 / usual[1] ** 2, 3))
        )
        off = np.append(body.shape, body.offsets - usual[0])
        self._pull = -np.diag(self._small) * off
        self._own = np.zeros(len(body.off_skin))
        self._own_pull = -self._say * (information @ body.off_skin)
        self._mixed = np.zeros((self._shapes, len(body.off_skin)))
        self._offsets = np.zeros((self._shapes, offsets))

    def add(self, kinematics: Kinematics, body: Body, frame: int, terms: Sequence[Term]) -> None:
        """Adds what a frame says."""
        posed: Posed = kinematics.posed(body, frame)
        moved = kinematics.reshaped(posed)
        shapes = self._shapes
        for term in terms:
            rows = term.rows(body, posed, frame)
            if not len(rows.numbers):
                continue
            way = rows.ways[:, None]  # (N, 1, 3)
            change = (way @ term.reshaped(posed, moved)[rows.numbers])[:, 0]  # (N, K)
            own = (way @ term.own(posed)[rows.numbers])[:, 0]  # (N, U)
            weighted = change * rows.weights[:, None]
            self._small[:shapes, :shapes] += weighted.T @ change
            self._pull[:shapes] += weighted.T @ rows.missing
            size = own.shape[1] * (int(rows.numbers.max()) + 1)
            for u in range(own.shape[1]):
                column = rows.numbers * own.shape[1] + u
                mixed = np.stack(
                    [np.bincount(column, w * own[:, u], size) for w in weighted.T]
                )  # (K, ≤)
                said = np.bincount(column, rows.weights * own[:, u] * rows.missing, size)
                if own.shape[1] == 1:
                    self._mixed[:, :size] += mixed
                    self._own_pull[:size] += said
                    self._own[:size] += np.bincount(column, rows.weights * own[:, u] ** 2, size)
                    continue
                self._offsets[:, :size] += mixed
                self._pull[shapes : shapes + size] += said
                for v in range(own.shape[1]):
                    other = shapes + rows.numbers * own.shape[1] + v
                    np.add.at(
                        self._small,
                        (shapes + column, other),
                        rows.weights * own[:, u] * own[:, v],
                    )

    def solve(self, body: Body) -> None:
        """One step of what is shared; the surface's stand-off is eliminated first."""
        shapes = self._shapes
        small = self._small.copy()
        small[:shapes, shapes:] += self._offsets
        small[shapes:, :shapes] += self._offsets.T
        surface = splu(csc_matrix(self._say * self._information + diags(self._own)))
        solved = surface.solve(self._mixed.T.copy())  # (S, K)
        small[:shapes, :shapes] -= self._mixed @ solved
        pull = self._pull.copy()
        pull[:shapes] -= solved.T @ self._own_pull
        step = np.linalg.solve(small, pull)
        body.shape += step[:shapes]
        body.offsets += step[shapes:].reshape(-1, 3)
        body.off_skin += surface.solve(self._own_pull - self._mixed.T @ step[:shapes])
