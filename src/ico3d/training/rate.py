"""Learning rates; this module imports no torch, because settings use it."""

from dataclasses import dataclass

REST_FACTOR = 1 / 20
"""Learning rate of harmonics above degree 0, as a factor of that of degree 0 (as in 3DGS)."""


@dataclass(frozen=True)
class Rate:
    """A learning rate that decays exponentially.

    Attributes:
        initial: The rate at step 0.
        decay: The rate at the last step, as a factor of `initial`.
    """

    initial: float
    decay: float = 1.0

    def at(self, progress: float) -> float:
        """The rate when a share `progress` (0 to 1) of the steps is done."""
        return self.initial * self.decay**progress
