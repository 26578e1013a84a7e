"""What the expression vector of a speech-driven head holds: speech values, then eye values."""

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
