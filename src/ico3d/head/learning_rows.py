"""Which rows of the latent basis learn, and at which Gaussians."""

from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

from ico3d.head.closeups import CloseUps
from ico3d.head.expressions import ExpressionTrack, evening_rates, is_of_eyes
from ico3d.head.model import HeadShape

STILL = 0.5
"""Gaussians that make more of the shoulders' movement than this do not follow the expression."""


class LearningRows:
    """Divides the R rows of a head's basis by the Gaussians at which they learn.

    Where there are close-ups, Gaussians at the mouth learn nothing from eyes and brows, whose
    movements fall together with those of lips by chance alone. Shoulders learn nothing from any
    expression, for the same reason.

    Attributes:
        factors: (R,) factors of the rows' learning rates.
    """

    def __init__(self, shape: HeadShape, track: ExpressionTrack, frames: Sequence[int], even: bool):
        """Takes what decides the rows.

        Args:
            shape: The head's sizes.
            track: Expressions by frame.
            frames: The training frames.
            even: Whether rows that are small in most frames learn faster.
        """
        self._neck = shape.neck
        self.factors = torch.ones(shape.rows)
        self._eyes = torch.zeros(shape.rows, dtype=torch.bool)
        self._bias = torch.zeros(shape.rows, dtype=torch.bool)
        self._bias[-1] = True
        if shape.blends:
            self._eyes[: track.size] = is_of_eyes(track)
            if even:
                self.factors[: track.size] = evening_rates(track, frames)

    def parts(self, means: Tensor, close_ups: CloseUps) -> Iterator[tuple[Tensor, Tensor | None]]:
        """Rows (R,) bool, and which Gaussians (N,) bool of those at (N, 3) learn by them.

        Every row is in one part. None stands for all Gaussians. All are on the CPU.
        """
        still = None if self._neck is None else self._neck.follows(means).cpu() > STILL  # (N,)
        mouth = close_ups.at_mouth(means) if close_ups else None  # (N,)
        if still is None and mouth is None:
            yield torch.ones_like(self._bias), None
            return
        if still is None:
            yield ~self._eyes, None
        else:
            yield self._bias, None
            yield ~self._bias & ~self._eyes, ~still
        held = [part for part in (still, mouth) if part is not None]
        yield self._eyes, ~torch.stack(held).any(0)
