"""The error of a face's blendshapes over time: what AUE measures, without OpenFace.

Blendshapes of MediaPipe (0 to 1, 51 of them) are not action units (0 to 5, 17 of them): the figures
have other sizes and must not stand in one column with AUE.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_UPPER = ("brow", "eye", "cheekSquint", "noseSneer")
_LOWER = ("jaw", "mouth", "cheekPuff", "tongue")


@dataclass(frozen=True)
class BlendshapeError:
    """Sums over blendshapes of the mean over time of the squared error.

    Attributes:
        lower: Over jaw, mouth, puffed cheeks and tongue.
        upper: Over brows, eyes, squinting cheeks and the nose: the regions that `UPPER` of
            `action_units` has units for.
    """

    lower: float
    upper: float


def blendshape_error(
    predicted: np.ndarray, truth: np.ndarray, names: Sequence[str]
) -> BlendshapeError | None:
    """Compares blendshapes of two videos frame by frame.

    The formula is that of AUE (see `action_unit_error`).

    Args:
        predicted: (T, S) weights; a frame with NaN does not count.
        truth: (T, S) weights of the same frames.
        names: Names of the S blendshapes (ARKit's, as MediaPipe has them); `_neutral` belongs to
            neither half of the face.

    Returns:
        The errors; None if no frame counts.
    """
    both = np.isfinite(predicted).all(1) & np.isfinite(truth).all(1)
    if not both.any():
        return None
    errors = ((predicted[both] - truth[both]) ** 2).mean(0)  # (S,)
    lower, upper = (
        np.array([name.startswith(part) for name in names]) for part in (_LOWER, _UPPER)
    )
    return BlendshapeError(float(errors[lower].sum()), float(errors[upper].sum()))
