"""What the expression vector of a speech-driven head holds: speech values, then eye values."""

from dataclasses import dataclass

import numpy as np

SPEECH_SIZE = 32
"""How many adapted speech features come first."""

EYE_NAMES = (
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "eyeBlinkLeft",
    "eyeBlinkRight",
)
"""The seven eye and brow values that complete the expression vector (ARKit names, 0 to 1)."""

LIDS = [i for i, name in enumerate(EYE_NAMES) if "Blink" in name]
"""Which of them are the eyelids."""


@dataclass(frozen=True)
class EyeRange:
    """How far the eyes and brows of one person were seen to move.

    A head knows nothing of what lies beyond: a brow that moved by a hundredth while it was
    recorded turns the whole face to rags when it is raised by half.

    Attributes:
        rest: (7,) values of `EYE_NAMES` at rest.
        most: (7,) the highest; at least those at rest.
    """

    rest: tuple[float, ...] = (0.0,) * len(EYE_NAMES)
    most: tuple[float, ...] = (1.0,) * len(EYE_NAMES)

    def values(self, shares: np.ndarray) -> np.ndarray:
        """Values (..., 7) of shares of the way from rest (0) to the most that was seen (1)."""
        rest, most = np.array(self.rest, np.float32), np.array(self.most, np.float32)  # (7,), (7,)
        return rest + np.asarray(shares, np.float32) * (most - rest)


def eye_range(recorded: np.ndarray) -> EyeRange:
    """What a recording (T, 7) tells: brows rest at their usual place, lids as open as they get."""
    rest = np.median(recorded, axis=0)  # (7,)
    rest[LIDS] = np.percentile(recorded[:, LIDS], 10, axis=0)
    most = np.maximum(recorded.max(axis=0), rest)
    return EyeRange(*(tuple(round(float(value), 6) for value in row) for row in (rest, most)))


def expression_rows(
    idle: np.ndarray, lips: np.ndarray, eyes: np.ndarray, eye_offset: int | None
) -> np.ndarray:
    """Whole expressions of a face whose mouth and eyes move.

    Args:
        idle: (B,) the resting face.
        lips: (n, C) what the mouth does; C = 0 for a mouth at rest.
        eyes: (n, 7) what eyes and brows do.
        eye_offset: Where their values start; None where the face has none.

    Returns:
        (n, B) float32.
    """
    rows = np.tile(np.asarray(idle, np.float32), (len(lips), 1))  # (n, B)
    rows[:, : lips.shape[1]] = lips
    if eye_offset is not None:
        rows[:, eye_offset : eye_offset + len(EYE_NAMES)] = eyes
    return rows
