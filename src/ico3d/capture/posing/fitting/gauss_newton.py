"""Fits the template by Gauss-Newton steps, some thirty of which lead from rest to any pose.

Each step first improves the pose of each frame, with priors from its neighbours in time, then the
parameters that all frames share. First-order methods would need thousands of steps, as a hip moves
a whole leg and the end of a finger only itself; the normal equations take this into account.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed
from ico3d.capture.posing.fitting.rows import LandmarkTerm, Rows, Term
from ico3d.capture.posing.fitting.surface import Surface
from ico3d.rig.quaternions import from_matrix, from_rotvec, slerp, to_matrix, to_rotvec

LARGEST_STEP = 0.4
"""Largest rotation of a joint in one step, radians."""
FIRST_DAMPING, DAMPED = 0.05, 0.75
"""Damping of the first step, relative to priors and normal matrix; its factor from step to step."""
LIMIT = 0.05
"""Standard deviation in radians by which a joint may bend beyond its stop."""
PLACE_PACE = 0.008
"""Usual change in metres of the root's displacement from one tenth of a second to the next."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a run of steps fits, and to what.

    Attributes:
        steps: Number of steps.
        shape_from: First step in which parameters that all frames share are fitted, too.
        outlines: Whether outlines count, beside landmarks.
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
        """Makes a solver for one recording.

        Args:
            kinematics: Forward kinematics of the template.
            landmarks: Term of the landmarks.
            surface: Term of the outlines.
            spread: (P, 3) standard deviation in metres of a person's landmarks from the template's.
            frames: (F,) indices in the recording of the frames that are fitted, ascending.
            fps: Frames per second of the recording.
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
            body: The parameters of the fit.
            plan: Number of steps, and what they take into account.
            done: Called after each step, to show progress.
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
        """One step of a frame's angles and root translation.

        Returns:
            (3 J + 3, 3 J + 3) normal matrix without the priors from neighbours in time, which do
            not resist changes that all frames share.
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
        """Priors of angles and root translation: (3 J + 3,) 1 / variances and (3 J + 3,) means."""
        anatomy, angles = self._anatomy, body.angles[frame]
        strength, pull = 1 / anatomy.spread**2, np.zeros(angles.shape)  # (J, 3)
        bend = angles[:, 0]
        stop = np.clip(bend, anatomy.bend[:, 0], anatomy.bend[:, 1])
        beyond = np.where(stop != bend, 1 / LIMIT**2, 0.0)
        strength[:, 0] += beyond
        pull[:, 0] += beyond * stop
        return np.append(strength, [1e-6] * 3), np.append(pull / strength, body.roots[frame])

    def _neighbours(self, body: Body, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Priors from the frames before and after: (3 J + 3,) 1 / variances and (3 J + 3,) means.

        Both are 0 where one of these frames is not fitted.
        """
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
    """Changes angles and root translation of a frame, in place.

    Args:
        body: The parameters of the fit.
        frame: Number of the frame in the fit.
        step: (3 J + 3,) wanted change; that of each joint is limited to `LARGEST_STEP`.

    Returns:
        (3 J + 3,) the change that was made.
    """
    angles = step[:-3].reshape(-1, 3)
    size = np.linalg.norm(angles, axis=-1, keepdims=True)
    angles = angles * np.minimum(1, LARGEST_STEP / np.maximum(size, 1e-9))
    body.angles[frame] += angles
    body.roots[frame] += step[-3:]
    return np.append(angles, step[-3:])


@dataclass(eq=False)
class _Seen:
    """The equations of a term about a frame.

    Attributes:
        term: The term.
        rows: The N equations.
        turning: (N, 3 J + 3) float32 derivatives of the equations by angles and root translation.
        weighted: (N, 3 J + 3) float32 `turning` times the weights of the equations.
        missing: (N,) residuals, which are updated when the pose changes.
    """

    term: Term
    rows: Rows
    turning: np.ndarray
    weighted: np.ndarray
    missing: np.ndarray

    @staticmethod
    def of(term: Term, body: Body, posed: Posed, frame: int) -> "_Seen":
        """Evaluates a term in a frame."""
        rows = term.rows(body, posed, frame)
        turning = posed.changes(rows.points, rows.ways, term.carried[rows.numbers])
        turning = turning.astype(np.float32)
        weighted = turning * rows.weights[:, None].astype(np.float32)
        return _Seen(term, rows, turning, weighted, rows.missing.copy())


def _calm(off: np.ndarray, pace: np.ndarray | float) -> np.ndarray:
    """1 / variance of a value that differs from its neighbours' mean by `off` (pseudo-Huber)."""
    return 4 / pace**2 / np.sqrt(1 + (2 * off / pace) ** 2)


def _root_angles(body: Body, frame: int) -> np.ndarray:
    """(3,) angles of the root with which its rotation is half-way between its neighbours'."""
    before, after = (
        from_matrix(body.root_turns[f] @ to_matrix(from_rotvec(body.angles[f, 0])))
        for f in (frame - 1, frame + 1)
    )
    between = to_matrix(slerp(before, after, 0.5))
    return to_rotvec(from_matrix(body.root_turns[frame].T @ between))


class _Shared:
    """Normal equations of the parameters that all frames share.

    These are shape, offsets of landmarks, and distances off the skin. Poses are eliminated (Schur
    complement), so they adapt to a change of shape: broader shoulders move the arms along.
    """

    def __init__(self, kinematics: Kinematics, body: Body, spread: np.ndarray, surface: Surface):
        """Begins with priors.

        Detectors make similar errors in neighbouring frames, so frames are not independent: to
        account for this, the priors' weight is the square root of the number of frames.
        """
        self._kinematics = kinematics
        shapes, marks, nodes = len(body.shape), body.offsets.size, len(body.off_skin)
        self._shapes, self._marks = shapes, marks
        self._own: dict[type, np.ndarray] = {
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
        """Adds the equations of a frame.

        Args:
            posed: The joints in this frame.
            seen: Equations of each term.
            normal: (3 J + 3, 3 J + 3) normal matrix of the frame's pose.
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
        """One step of the shared parameters, and of all poses with them."""
        step = np.linalg.solve(self._normal, self._pull)
        shape, offsets, off_skin = np.split(step, [self._shapes, self._shapes + self._marks])
        body.shape += shape
        body.offsets += offsets.reshape(-1, 3)
        body.off_skin += off_skin
        for frame, following in enumerate(self._following):
            turn(body, frame, -(following @ step))
