"""Scores of features of lips and of sound: the published definition of Sync-C and Sync-D."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad, pairwise_distance

SHIFTS = 15
"""Frames by which the sound is shifted at most, to either side."""


@dataclass(frozen=True)
class SyncScores:
    """How well lips and sound of a video fit (Chung and Zisserman 2016).

    A constant delay between lips and sound makes neither score worse: `offset` tells of it.

    Attributes:
        confidence: Sync-C, the median of the mean distances at all shifts less the least one.
        distance: Sync-D, the least mean distance; the paper calls it Sync-E.
        offset: Frames (of 1/25 s) by which the sound is early where the distance is least.
        frames: Number of frames of the face.
        detector: What found the face: `s3fd`, as published, or `mediapipe`.
    """

    confidence: float
    distance: float
    offset: int
    frames: int
    detector: str

    def figures(self) -> dict[str, float | int | str]:
        """The scores by the names of metrics (docs/architecture.md, "Metrics")."""
        return {
            "sync_c": self.confidence,
            "sync_d": self.distance,
            "sync_offset": self.offset,
            "sync_faces_by": self.detector,
        }


def mean_distances(lips: Tensor, sound: Tensor) -> Tensor:
    """Mean distance of lips and sound at each shift of the sound.

    Where a shift leaves the sound, features of 0 stand in for it, and these distances count as much
    as any other: so does the published program.

    Args:
        lips: (T, C) features of pictures.
        sound: (T, C) features of sound at the same times.

    Returns:
        (31,): at entry k the sound is shifted by k − 15 frames.
    """
    padded = pad(sound, (0, 0, SHIFTS, SHIFTS))  # (T + 30, C)
    count = len(lips)
    shifted = (padded[k : k + count] for k in range(2 * SHIFTS + 1))
    return torch.stack([pairwise_distance(lips, other).mean() for other in shifted])


def scores_of(lips: Tensor, sound: Tensor, frames: int, detector: str) -> SyncScores:
    """Scores of features (T, C) of pictures and of sound at the same times."""
    means = mean_distances(lips, sound)  # (31,)
    least = int(means.argmin())
    distance = float(means[least])
    return SyncScores(float(means.median()) - distance, distance, SHIFTS - least, frames, detector)
