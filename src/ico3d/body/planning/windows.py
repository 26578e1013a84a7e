"""Cuts a clip into windows where much has moved (SWinGS, section on adaptive windows)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ico3d.common.spread import spread
from ico3d.errors import SettingsError


@dataclass(frozen=True)
class Window:
    """A span of frames with its own Gaussians.

    Attributes:
        first: First frame.
        last: Last frame, included; the next window begins with this frame.
    """

    first: int
    last: int

    def __len__(self) -> int:
        return self.last - self.first + 1

    @property
    def frames(self) -> range:
        """Numbers of all frames of the window."""
        return range(self.first, self.last + 1)

    @property
    def center(self) -> int:
        """The frame in the middle, on whose surface the canonical Gaussians begin."""
        return (self.first + self.last) // 2

    def moments(self, most: int) -> list[int]:
        """At most `most` frames, evenly spread, first and last among them."""
        return [self.frames[index] for index in spread(len(self), most)]

    def tau(self, frame: float) -> float:
        """Time τ within the window: 0 at its first frame, 1 at its last."""
        return (frame - self.first) / max(self.last - self.first, 1)


def segments(frames: int, length: int) -> tuple[Window, ...]:
    """Cuts a clip into windows of equal length, whatever moves; neighbours share one frame.

    Args:
        frames: Number of frames of the clip.
        length: Number of frames of a window, but for the shared ones; 0 for a single window.
    """
    count = min(math.ceil(frames / length), max(frames - 1, 1)) if length else 1
    edges = np.linspace(0, frames - 1, count + 1).round().astype(int).tolist()
    return tuple(Window(first, last) for first, last in pairwise(edges))


def cut(
    motion: Sequence[float] | np.ndarray, threshold: float, shortest: int, longest: int
) -> tuple[Window, ...]:
    """Cuts a clip into windows that share one frame with their neighbours.

    The cut is greedy: a window takes step after step, and ends before the step that would raise its
    summed motion above the threshold, so that a fast jump begins the next window. A window that
    would end within a burst of motion ends before the burst. If the remaining steps could then not
    be divided within the bounds, the window is made shorter, else longer, by as few steps as
    possible. If the whole clip cannot be divided within the bounds, windows may be longer than
    `longest`, by as little as possible; a clip shorter than `shortest` is one window.

    A burst is a run of steps so large that a window of `longest` frames of them would exceed half
    the threshold.

    Args:
        motion: (F − 1,) motion from frame i to frame i + 1; not negative.
        threshold: Largest summed motion of a window, unless it has the shortest length.
        shortest: Least number of frames of a window, 2 or more.
        longest: Largest number of frames of a window.

    Returns:
        Windows from frame 0 to frame F − 1.

    Raises:
        SettingsError: If the bounds or the threshold contradict one another.
        ValueError: If motion is negative or not finite.
    """
    motion = np.asarray(motion, np.float64)
    if not 2 <= shortest <= longest or not threshold > 0:
        raise SettingsError(
            f"windows of {shortest} to {longest} frames and {threshold} motion are impossible: "
            "the shortest has 2 frames or more, the longest no fewer, and the threshold is above 0."
        )
    if not (np.isfinite(motion) & (motion >= 0)).all():
        raise ValueError("motion must be finite and not negative.")
    fewest, most = _bounds(len(motion), shortest - 1, longest - 1)
    total = np.concatenate([[0.0], np.cumsum(motion)])  # (F,) motion before each frame
    bursting = motion > threshold / 2 / (longest - 1)  # (F − 1,)
    windows, first = [], 0
    while not windows or first < len(motion):
        moved = total[first + 1 : first + 1 + most] - total[first]
        calm = int(np.searchsorted(moved, threshold, side="right"))
        wanted = _before_burst(bursting[first:], max(calm, fewest), fewest)
        steps = _possible(wanted, len(motion) - first, fewest, most)
        windows.append(Window(first, first + steps))
        first += steps
    return tuple(windows)


def _bounds(steps: int, fewest: int, most: int) -> tuple[int, int]:
    """Least and largest number of steps of a window, widened until `steps` can be divided."""
    if steps < fewest:
        return steps, steps
    return fewest, max(most, math.ceil(steps / (steps // fewest)))


def _divisible(steps: int, fewest: int, most: int) -> bool:
    """Whether `steps` can be divided into windows of `fewest` to `most` steps each."""
    return steps == 0 or steps <= (steps // fewest) * most


def _before_burst(bursting: np.ndarray, steps: int, fewest: int) -> int:
    """Steps of a window that ends before a burst, if `steps` steps would end within the burst."""
    if not bursting[steps - 1 : steps + 1].all() or steps >= len(bursting):
        return steps
    calm = np.flatnonzero(~bursting[fewest - 1 : steps])
    return fewest + int(calm[-1]) if len(calm) else steps


def _possible(wanted: int, left: int, fewest: int, most: int) -> int:
    """The number of steps nearest to `wanted` that leaves a divisible rest; fewer before more."""
    shorter = range(min(wanted, left), fewest - 1, -1)
    longer = range(wanted + 1, min(most, left) + 1)
    fitting = (s for s in (*shorter, *longer) if _divisible(left - s, fewest, most))
    return next(fitting, left)
