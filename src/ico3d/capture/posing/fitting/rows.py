"""Linearised equations of a fit: what is missed by how much, and what would mend it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed, mixed
from ico3d.capture.posing.model.template import Template


@dataclass(frozen=True, eq=False)
class Rows:
    """N scalar equations about one frame: way · (point's move) = missing, with weights.

    Attributes:
        points: (N, 3) in the world.
        ways: (N, 3).
        missing: (N,) metres.
        weights: (N,) 1 / variance, robust ones already lowered.
        numbers: (N,) which of the term's points they are about.
    """

    points: np.ndarray
    ways: np.ndarray
    missing: np.ndarray
    weights: np.ndarray
    numbers: np.ndarray


class Term(Protocol):
    """One kind of evidence about points that the body carries."""

    carried: np.ndarray
    """(P, J) part of each point that hangs on each joint or below it."""

    def rows(self, body: Body, posed: Posed, frame: int) -> Rows:
        """Equations about a frame."""
        ...

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """(P, 3, K) metres that its points move by one of each shape coefficient.

        Args:
            posed: The body.
            moved: (K, J, 3) that its joints move.
        """
        ...

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """(N, U) metres that points of rows go along their ways by one of the term's U unknowns."""
        ...


class LandmarkTerm:
    """Named points near places in space."""

    def __init__(self, kinematics: Kinematics, points: np.ndarray, roots: np.ndarray):
        """Takes over the evidence.

        Args:
            kinematics: Of the template.
            points: (F, P, 3) metres.
            roots: (F, P, 3, 3) square roots of their information: rows are ways in space, as long
                as 1 / metres that the point is known to along it; 0 where unknown.
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
        """(P, 3) landmarks in the world."""
        rest = mixed(self._template.places, body.shape) + body.offsets
        local = rest - posed.joints[self._carriers]
        turns = posed.turns[self._carriers]
        return np.einsum("pab,pb->pa", turns, local) + posed.places[self._carriers]

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """As `Term` says."""
        basis, joints = self._template.places[1:], self._template.joints[1:]
        local = basis - joints[:, self._carriers]  # (K, P, 3)
        turned = np.einsum("pab,kpb->pak", posed.turns[self._carriers], local)
        return turned + moved[:, self._carriers].transpose(1, 2, 0)

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """By three offsets of each landmark."""
        turned = np.einsum("na,nab->nb", rows.ways, posed.turns[self._carriers[rows.numbers]])
        moves = np.zeros((len(rows.numbers), len(self._carriers), 3))
        moves[np.arange(len(rows.numbers)), rows.numbers] = turned
        return moves.reshape(len(rows.numbers), 3 * len(self._carriers))
