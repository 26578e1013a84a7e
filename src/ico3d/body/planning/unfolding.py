"""Frames of a window join its training one after another, from the middle outwards."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.body.planning.windows import Window

LEAST_LACK = 0.01
"""Steps that a frame is counted to lack at least, so that any frame can be drawn at any time."""


@dataclass(frozen=True)
class Unfolding:
    """Which frames of a window a step may learn from, and from which one it learns.

    A step's frame is drawn in proportion to the steps that each joined frame still lacks, so that
    in the end all have had about the same number.

    Attributes:
        window: Frames of the window.
        frames: Those of them that have pictures.
        first: First step that learns from more than the middle frame.
        steps: Number of steps of the training.
        share: Share of `steps`, counted from `first`, after which all frames have joined.
        seed: Seed of the draws.
    """

    window: Window
    frames: Sequence[int]
    first: int
    steps: int
    share: float
    seed: int

    def joining(self, step: int) -> list[tuple[int, int]]:
        """Frames that join at a step, nearest to the middle first, each with its inner neighbour.

        Frames without pictures join, too, since their neighbours come after them.
        """
        center, before = self.window.center, self._radius(step - 1)
        return [
            (center + side * away, center + side * (away - 1))
            for away in range(before + 1, self._radius(step) + 1)
            for side in (-1, 1)
            if center + side * away in self.window.frames
        ]

    def frame(self, step: int) -> int:
        """The frame from which a step, `first` or later, learns."""
        return self._drawn[step - self.first]

    def _radius(self, step: int) -> int:
        """How many frames before and after the middle frame have joined at a step."""
        if step < self.first:
            return 0
        window = self.window
        half = max(window.center - window.first, window.last - window.center)
        part = (step - self.first + 1) / max(self.share * self.steps, 1)
        return math.ceil(min(part, 1.0) * half)

    @cached_property
    def _drawn(self) -> list[int]:
        """The frames of all steps from `first` on."""
        rng = np.random.default_rng([self.seed, len(self.frames)])
        frames = np.array(self.frames)  # (F,)
        away = np.abs(frames - self.window.center)  # (F,)
        count = self.steps - self.first
        lack = np.full(len(frames), count / len(frames))  # (F,) steps that are still due
        drawn = []
        for step in range(self.first, self.steps):
            near = away <= max(self._radius(step), away.min())  # (F,)
            weights = near * lack.clip(LEAST_LACK)  # (F,)
            chosen = rng.choice(len(frames), p=weights / weights.sum())
            lack[chosen] -= 1
            drawn.append(int(frames[chosen]))
        return drawn
