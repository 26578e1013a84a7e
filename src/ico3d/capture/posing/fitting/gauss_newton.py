"""The template brought to what was seen by Gauss-Newton steps: from rest to any pose in thirty.

Poses of single frames, held together by their neighbours in time, and what all frames share take
turns. First-order methods need thousands of steps here, because a hip moves a whole leg and the
end of a finger nothing but itself; the normal equations know that.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed
from ico3d.capture.posing.fitting.rows import LandmarkTerm, Rows, Term
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
        spread: np.ndarray,
        frames: np.ndarray,
        fps: float,
    ):
        """Takes over what does not change.

        Args:
            kinematics: Of the template.
            landmarks: Evidence by points.
            surface: Evidence by outlines.
            spread: (P, 3) metres that landmarks usually lie elsewhere than on the template.
            frames: (F,) numbers in the recording of the frames that are fitted.
            fps: The recording's frames per second.
        """
        self._kinematics, self._anatomy = kinematics, kinematics.anatomy
        self._landmarks, self._surface = landmarks, surface
        self._spread = spread
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
            shared = _Shared(self._kinematics, body, self._spread, self._surface)
            for frame in range(len(body.roots)):
                posed = self._kinematics.posed(body, frame)
                seen = [_Seen.of(term, body, posed, frame) for term in terms]
                normal = self._pose(body, frame, seen, damping)
                if step >= plan.shape_from:
                    shared.add(posed, seen, normal)
            if step >= plan.shape_from:
                shared.solve(body)
            done()

    def _pose(self, body: Body, frame: int, seen: Sequence["_Seen"], damping: float) -> np.ndarray:
        """One step of a frame's angles and root.

        Returns:
            (3 J + 3, 3 J + 3) normal matrix without the neighbours in time: of what the pose
            resists where all frames turn alike.
        """
        normal = np.sum([one.turning.T @ one.weighted for one in seen], 0, dtype=float)
        pull = np.sum([one.weighted.T @ one.missing for one in seen], 0)
        (strength, aim), (calm, middle) = self._prior(body, frame), self._neighbours(body, frame)
        now = np.append(body.angles[frame], body.roots[frame])
        slow = np.append(1 / self._anatomy.spread.ravel() ** 2, [1.0] * 3)
        number = np.arange(len(now))
        normal[number, number] += strength + damping * (slow + normal[number, number])
        pull += strength * (aim - now) + calm * (middle - now)
        step = turn(body, frame, np.linalg.solve(normal + np.diag(calm), pull))
        for one in seen:
            one.missing -= one.turning @ step
        return normal

    def _prior(self, body: Body, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """1 / variance (3 J + 3,) of angles and root before anything is seen, and their means."""
        anatomy, angles = self._anatomy, body.angles[frame]
        strength, pull = 1 / anatomy.spread**2, np.zeros(angles.shape)  # (J, 3)
        bend = angles[:, 0]
        stop = np.clip(bend, anatomy.bend[:, 0], anatomy.bend[:, 1])
        beyond = np.where(stop != bend, 1 / LIMIT**2, 0.0)
        strength[:, 0] += beyond
        pull[:, 0] += beyond * stop
        return np.append(strength, [1e-6] * 3), np.append(pull / strength, body.roots[frame])

    def _neighbours(self, body: Body, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """The same that the frames before and after say; 0 where one of them is missing."""
        if not self._between[frame]:
            nothing = np.zeros(body.angles[frame].size + 3)
            return nothing, nothing
        around = 0.5 * (body.angles[frame - 1] + body.angles[frame + 1])
        around[0] = _root_angles(body, frame)
        middle = 0.5 * (body.roots[frame - 1] + body.roots[frame + 1])
        calm = _calm(body.angles[frame] - around, self._pace[:, None])
        root = _calm(body.roots[frame] - middle, self._root_pace)
        return np.append(calm, root), np.append(around, middle)


def turn(body: Body, frame: int, step: np.ndarray) -> np.ndarray:
    """Turns and moves a frame's body by (3 J + 3,), by no more than `LARGEST_STEP`; by what."""
    angles = step[:-3].reshape(-1, 3)
    size = np.linalg.norm(angles, axis=-1, keepdims=True)
    angles = angles * np.minimum(1, LARGEST_STEP / np.maximum(size, 1e-9))
    body.angles[frame] += angles
    body.roots[frame] += step[-3:]
    return np.append(angles, step[-3:])


@dataclass(eq=False)
class _Seen:
    """What a term says about a frame.

    Attributes:
        term: The term.
        rows: Its equations.
        turning: (N, 3 J + 3) float32: how points go along their ways, by angles and root.
        weighted: The same times the rows' weights.
        missing: (N,) metres that are missed.
    """

    term: Term
    rows: Rows
    turning: np.ndarray
    weighted: np.ndarray
    missing: np.ndarray

    @staticmethod
    def of(term: Term, body: Body, posed: Posed, frame: int) -> "_Seen":
        """Asks a term."""
        rows = term.rows(body, posed, frame)
        turning = posed.changes(rows.points, rows.ways, term.carried[rows.numbers])
        turning = turning.astype(np.float32)
        weighted = turning * rows.weights[:, None].astype(np.float32)
        return _Seen(term, rows, turning, weighted, rows.missing.copy())


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
    """Normal equations of what all frames share: shape, offsets of landmarks, stand-off.

    Poses give way to it as far as they like (Schur's complement): shoulders that grow broad move
    arms along.
    """

    def __init__(self, kinematics: Kinematics, body: Body, spread: np.ndarray, surface: Surface):
        """Begins with priors.

        Detectors err alike in neighbouring frames, so that frames are not as many witnesses:
        priors count as often as the root of their number.
        """
        self._kinematics = kinematics
        shapes, marks, nodes = len(body.shape), body.offsets.size, len(body.off_skin)
        self._shapes, self._marks = shapes, marks
        self._own = {
            LandmarkTerm: shapes + np.arange(marks),
            Surface: shapes + marks + np.arange(nodes),
        }
        information = np.zeros((shapes + marks + nodes,) * 2)
        known = np.append(np.ones(shapes), 1 / spread.ravel() ** 2)
        information[: len(known), : len(known)] = np.diag(known)
        information[len(known) :, len(known) :] = surface.information
        off = np.concatenate([body.shape, body.offsets.ravel(), body.off_skin - surface.usual])
        self._normal = len(body.roots) ** 0.5 * information
        self._pull = -self._normal @ off
        self._following: list[np.ndarray] = []

    def add(self, posed: Posed, seen: Sequence[_Seen], normal: np.ndarray) -> None:
        """Adds what a frame says.

        Args:
            posed: The body in it.
            seen: By each term.
            normal: (3 J + 3, 3 J + 3) of its pose.
        """
        moved = self._kinematics.reshaped(posed)
        mixed = np.zeros((len(normal), len(self._pull)))
        for one in seen:
            if not len(one.missing):
                continue
            rows, term = one.rows, one.term
            reshaped = term.reshaped(posed, moved)[rows.numbers]  # (N, 3, K)
            change = (rows.ways[:, None] @ reshaped)[:, 0]  # (N, K)
            system = np.concatenate([change, term.own(posed, rows)], 1).astype(np.float32)
            weighted = system * rows.weights[:, None].astype(np.float32)
            unknown = np.append(np.arange(self._shapes), self._own[type(term)])
            self._normal[np.ix_(unknown, unknown)] += weighted.T @ system
            self._pull[unknown] += weighted.T @ one.missing
            mixed[:, unknown] += one.turning.T @ weighted
        following = np.linalg.solve(normal, mixed)
        self._normal -= mixed.T @ following
        self._following.append(following.astype(np.float32))

    def solve(self, body: Body) -> None:
        """One step of what is shared; poses follow."""
        step = np.linalg.solve(self._normal, self._pull)
        shape, offsets, off_skin = np.split(step, [self._shapes, self._shapes + self._marks])
        body.shape += shape
        body.offsets += offsets.reshape(-1, 3)
        body.off_skin += off_skin
        for frame, following in enumerate(self._following):
            turn(body, frame, -(following @ step))
