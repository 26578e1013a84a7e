"""What drives a head: speech, then eyes and brows, then a smile; and how the head is turned."""

from dataclasses import dataclass

import numpy as np

SPEECH_SIZE = 32
"""Number of speech values at the start of the expression vector."""

EYE_NAMES = (
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "eyeBlinkLeft",
    "eyeBlinkRight",
)
"""ARKit names of the seven eye and brow values, 0 to 1, after the speech values."""

FACE_NAMES = (*EYE_NAMES, "smile")
"""The values after those of speech, the last of which not every head knows."""

SMILES = ("mouthSmileLeft", "mouthSmileRight")
"""ARKit names of the blendshapes whose mean is the smile, which heads that know it have last."""

TURN_SIZE = 3
"""Number of values that tell how a head is turned, after the expression vector."""

MOST_DISPLACEMENTS = 16
"""Largest number of ways in which a head's Gaussians move with its expression."""

EYE_UNIT = 1.25e-4
"""Metres per radian of a unit of the displacements that turn a head's eyes."""

MOVE_HIDDEN = 64
"""Width of the network from an expression to how far a head's Gaussians move."""

LEAKY_SLOPE = 0.02
"""Slope below 0 of the hidden units of networks that a baked head has."""

LIDS = [i for i, name in enumerate(EYE_NAMES) if "Blink" in name]
"""Indices of the eyelids in `EYE_NAMES`."""


@dataclass(frozen=True)
class EyeRange:
    """How far eyes and brows of one person, and the smile where a head knows it, were seen to move.

    A head model is undefined outside of the values it was trained with: where a brow moved by 0.01
    in the recording, raising it by 0.5 tears the whole face apart.

    Attributes:
        rest: (7,) values of eyes and brows at rest, in the order of `EYE_NAMES`; (8,) with the
            smile.
        most: (7,) or (8,) highest values seen, none below `rest`.
    """

    rest: tuple[float, ...] = (0.0,) * len(EYE_NAMES)
    most: tuple[float, ...] = (1.0,) * len(EYE_NAMES)

    def values(self, shares: np.ndarray) -> np.ndarray:
        """Values (..., V) of shares (..., V) of the way from rest (0) to the highest seen (1)."""
        rest, most = np.array(self.rest, np.float32), np.array(self.most, np.float32)  # (V,), (V,)
        return rest + np.asarray(shares, np.float32) * (most - rest)


def eye_range(recorded: np.ndarray) -> EyeRange:
    """The range of eyes and brows in a recording (T, 7), or of these and the smile (T, 8).

    Brows and smile rest at their median; lids rest at the 10th percentile of closure, nearly fully
    open.
    """
    rest = np.median(recorded, axis=0)  # (V,)
    rest[LIDS] = np.percentile(recorded[:, LIDS], 10, axis=0)
    most = np.maximum(recorded.max(axis=0), rest)
    return EyeRange(*(tuple(round(float(value), 6) for value in row) for row in (rest, most)))


def expression_rows(
    idle: np.ndarray, lips: np.ndarray, eyes: np.ndarray, eye_offset: int | None
) -> np.ndarray:
    """Expression vectors of a face from separate values for mouth and eyes.

    Args:
        idle: (B,) expression of the resting face.
        lips: (n, C) values of the mouth, put at the start of each row; C = 0 for a mouth at rest.
        eyes: (n, 7) values of eyes and brows, or (n, 8) with a smile, which heads that do not know
            it leave out.
        eye_offset: Column at which the values of the eyes start; None for a face without them.

    Returns:
        (n, B) float32.
    """
    rows = np.tile(np.asarray(idle, np.float32), (len(lips), 1))  # (n, B)
    rows[:, : lips.shape[1]] = lips
    if eye_offset is not None:
        room = rows[:, eye_offset : eye_offset + eyes.shape[1]]  # (n, 7 or 8)
        room[:] = eyes[:, : room.shape[1]]
    return rows
