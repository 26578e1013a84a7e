"""Learning rates; settings name them, so this needs no torch."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """A learning rate that decays exponentially.

    Attributes:
        initial: The rate at step 0.
        decay: The factor it has reached at the last step.
    """

    initial: float
    decay: float = 1.0

    def at(self, progress: float) -> float:
        """The rate when `progress` (0 to 1) of the steps are done."""
        return self.initial * self.decay**progress
