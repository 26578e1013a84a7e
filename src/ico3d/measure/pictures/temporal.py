"""Temporal flicker: changes from frame to frame that the recording does not have."""

from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np


def flicker(
    predicted: tuple[np.ndarray, np.ndarray],
    truth: tuple[np.ndarray, np.ndarray],
    mask: np.ndarray | None = None,
) -> float | None:
    """Difference of the changes from one frame to the next: Σ m·|Δpredicted − Δtruth| / (3·Σ m).

    This is the temporal difference of Chu et al. 2020 (TecoGAN, tLP) with colours in place of
    LPIPS. An error that stays the same does not count; a picture that stands still counts as much
    as the recording moves, and noise of standard deviation s as 1.13·s.

    Args:
        predicted: (H, W, 3) in [0, 1], of two consecutive frames.
        truth: (H, W, 3) in [0, 1], of the same two frames.
        mask: (H, W) weights in [0, 1]; None for the whole picture.

    Returns:
        The mean difference of a colour; None where the mask is empty.
    """
    change = predicted[1].astype(np.float64) - predicted[0]  # (H, W, 3)
    error = np.abs(change - (truth[1].astype(np.float64) - truth[0]))  # (H, W, 3)
    if mask is None:
        return float(error.mean())
    area = float(mask.sum(dtype=np.float64))
    return float((error * mask[..., None]).sum() / (3 * area)) if area else None


@dataclass
class TemporalFlicker:
    """Takes pictures one by one, and measures each with the one of the frame before.

    Attributes:
        values: What `flicker` found.
    """

    values: list[float] = field(default_factory=list)
    _last: dict[Hashable, tuple[int, np.ndarray, np.ndarray, np.ndarray | None]] = field(
        default_factory=dict
    )

    def add(
        self,
        camera: Hashable,
        frame: int,
        predicted: np.ndarray,
        truth: np.ndarray,
        mask: np.ndarray | None = None,
    ) -> float | None:
        """Takes the next picture of a camera.

        Args:
            camera: Whatever tells cameras apart; only the last picture of each is kept.
            frame: Number of the frame.
            predicted: (H, W, 3) in [0, 1].
            truth: (H, W, 3) in [0, 1].
            mask: (H, W) the person; a pixel counts with its larger mask of the two frames.

        Returns:
            The flicker since the frame before; None if the last picture of the camera was another
            frame's, or the masks are empty.
        """
        before = self._last.get(camera)
        self._last[camera] = (frame, predicted, truth, mask)
        if before is None or before[0] != frame - 1:
            return None
        both = None if mask is None or before[3] is None else np.maximum(mask, before[3])
        value = flicker((before[1], predicted), (before[2], truth), both)
        if value is not None:
            self.values.append(value)
        return value

    def mean(self) -> float | None:
        """Mean over all pairs of consecutive frames; None if there was none."""
        return float(np.mean(self.values)) if self.values else None
