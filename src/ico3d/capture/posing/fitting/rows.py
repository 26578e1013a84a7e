"""Linearised equations of a fit, and the term of the landmarks."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed, mixed
from ico3d.capture.posing.model.template import Template


@dataclass(frozen=True, eq=False)
class Rows:
    """N scalar equations about one frame: way · (displacement of the point) = missing.

    Attributes:
        points: (N, 3) positions in the world, metres.
        ways: (N, 3) directions, of any length.
        missing: (N,) wanted displacement along the direction, times the direction's length.
        weights: (N,) weights of the squared residuals, already lowered for outliers.
        numbers: (N,) index of each equation's point among the points of the term.
    """

    points: np.ndarray
    ways: np.ndarray
    missing: np.ndarray
    weights: np.ndarray
    numbers: np.ndarray


class Term(Protocol):
    """One kind of evidence, about P points that the body carries."""

    carried: np.ndarray
    """(P, J) share of each point that is carried by each joint or a joint below it."""

    def rows(self, body: Body, posed: Posed, frame: int) -> Rows:
        """Equations about frame number `frame` of the fit."""
        ...

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """(P, 3, K) derivatives of the points' positions in the world by shape coefficients.

        Args:
            posed: The joints in the frame.
            moved: (K, J, 3) derivatives of the joints' positions, from `Kinematics.reshaped`.
        """
        ...

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """(N, U) derivatives of the equations by the U shared parameters of this term."""
        ...


class LandmarkTerm:
    """A `Term` of P landmarks whose positions in space are known."""

    def __init__(self, kinematics: Kinematics, points: np.ndarray, roots: np.ndarray):
        """Makes the term.

        Args:
            kinematics: Forward kinematics of the template.
            points: (F, P, 3) seen positions of the landmarks in the world, metres.
            roots: (F, P, 3, 3) square roots of the positions' information matrices: each row is a
                direction, divided by the standard deviation in metres along it; 0 where a landmark
                is unknown.
        """
        self._template: Template = kinematics.template
        self._points, self._roots = points, roots
        self._carriers = self._template.carriers
        self.carried = kinematics.below[self._carriers].astype(float)

    def rows(self, body: Body, posed: Posed, frame: int) -> Rows:
        """Three equations for each landmark."""
        marks = self.marks(body, posed)
        roots = self._roots[frame]  # (P, 3, 3)
        away = self._points[frame] - marks  # (P, 3)
        off = np.einsum("pab,pb->pa", roots, away)
        say = 1 / np.sqrt(1 + (off**2).sum(-1))  # (P,) pseudo-Huber
        return Rows(
            np.repeat(marks, 3, 0),
            roots.reshape(-1, 3),
            off.reshape(-1),
            np.repeat(say, 3),
            np.repeat(np.arange(len(marks)), 3),
        )

    def marks(self, body: Body, posed: Posed) -> np.ndarray:
        """(P, 3) positions of the body's landmarks in the world, metres."""
        rest = mixed(self._template.places, body.shape) + body.offsets
        local = rest - posed.joints[self._carriers]
        turns = posed.turns[self._carriers]
        return np.einsum("pab,pb->pa", turns, local) + posed.places[self._carriers]

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """(P, 3, K) derivatives of the landmarks by shape coefficients, see `Term.reshaped`."""
        basis, joints = self._template.places[1:], self._template.joints[1:]
        local = basis - joints[:, self._carriers]  # (K, P, 3)
        turned = np.einsum("pab,kpb->pak", posed.turns[self._carriers], local)
        return turned + moved[:, self._carriers].transpose(1, 2, 0)

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """(N, 3 P) derivatives by the offsets of the landmarks, see `Term.own`."""
        turned = np.einsum("na,nab->nb", rows.ways, posed.turns[self._carriers[rows.numbers]])
        moves = np.zeros((len(rows.numbers), len(self._carriers), 3))
        moves[np.arange(len(rows.numbers)), rows.numbers] = turned
        return moves.reshape(len(rows.numbers), 3 * len(self._carriers))
