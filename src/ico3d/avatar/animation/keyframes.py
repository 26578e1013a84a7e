"""Finds where a body rests and at which frames its motion may turn around.

The paper picks these key frames by hand (section "Procedural Body Animation"). Here they follow
from how fast the hands are, which are what moves most: somebody rests while they are slow for
long, and where they slow down away from rest, motion can turn around or be held.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import KDTree

from ico3d.avatar.moving import MovingBody
from ico3d.bundle.animation import ANIMATION, Action, Animation, Rest
from ico3d.errors import BundleError

SEEN = 0.1
"""Opacity from which a Gaussian counts."""
FASTEST = (0.9, 0.99)
"""The share of the Gaussians that are hands and forearms; beyond it are strays."""
MOST_POINTS = 4000
"""Gaussians of a frame that are compared with the rest pose."""
CALM = 0.05
"""Metres per second below which hands rest in any case."""
LEAST_REST = 0.5
"""Seconds that a rest loop should have, if the clip allows it."""
ENDS = 0.2
"""Part of a calm span in which the frame with the slowest hands is looked for, at either end."""
DIP = 1.5
"""How many times faster the hands must be before and after an action."""
AWAY = 0.98
"""Quantile of the distances from the rest pose that tells how far the hands are from it."""
LEAST_AWAY = 0.04
"""Metres from the rest pose from which a pose is an action."""
AROUND = 0.3
"""Seconds before and after an action in which its motion is judged."""
MOST_ACTIONS = 24


@dataclass(frozen=True)
class Motion:
    """How a body moves through its clip of F frames.

    Attributes:
        fps: Frames per second.
        speeds: (F,) metres per second of the hands, the mean of the steps before and after.
        places: F times (N, 3) metres: where the Gaussians that are seen are.
    """

    fps: float
    speeds: np.ndarray
    places: tuple[np.ndarray, ...]

    @staticmethod
    def of(body: MovingBody, windows: Iterable[np.ndarray] | None = None) -> "Motion":
        """Measures a body.

        Args:
            body: The body; within a window its Gaussians stay the same ones.
            windows: What `window_places` yields, for callers that show how it goes.
        """
        speeds, places = [], []
        for window in window_places(body) if windows is None else windows:
            speeds += [_hands(step) * body.fps for step in np.diff(window, axis=0)]
            places += list(window[1 if places else 0 :])
        steps = np.array(speeds)  # (F - 1,)
        padded = np.concatenate([steps[:1], steps, steps[-1:]])  # (F + 1,)
        return Motion(body.fps, (padded[:-1] + padded[1:]) / 2, tuple(places))

    def away(self, frame: int, rest: int) -> float:
        """Metres that the hands are from a pose of rest; Gaussians need not be the same."""
        one, other = (self._thinned(number) for number in (frame, rest))
        return float(np.quantile(KDTree(other).query(one)[0], AWAY))

    def _thinned(self, frame: int) -> np.ndarray:
        return self.places[frame][:: len(self.places[frame]) // MOST_POINTS + 1]


@torch.no_grad()
def window_places(body: MovingBody) -> Iterator[np.ndarray]:
    """Where the Gaussians of each window are that are seen: (frames, N, 3) metres."""
    for index, span in enumerate(body.windows):
        taus = np.linspace(0, 1, span.last - span.first + 1)
        shown = [body.window_gaussians(index, float(tau)) for tau in taus]
        opacities = torch.stack([gaussians.opacities for gaussians in shown]).mean(0)  # (N,)
        seen = opacities > SEEN if (opacities > SEEN).any() else opacities >= 0
        yield torch.stack([gaussians.means[seen] for gaussians in shown]).cpu().numpy()


def read_animation(folder: Path, body: MovingBody) -> Animation | None:
    """The `animation.json` of a model's folder, if somebody put one there.

    Raises:
        BundleError: If it makes no sense, or is for another body.
    """
    file, frames = folder / ANIMATION, body.windows[-1].last + 1
    if not file.is_file():
        return None
    try:
        animation = Animation.from_bytes(file.read_bytes())
    except BundleError as error:
        raise BundleError(f"{folder}: {error}") from error
    if (animation.fps, animation.num_frames) != (body.fps, frames):
        raise BundleError(
            f"{file} is for a body of {animation.num_frames} frames at {animation.fps:g} per "
            f"second, but this one has {frames} at {body.fps:g}: delete it to find key frames anew."
        )
    return animation


def find_animation(motion: Motion) -> Animation:
    """The rest loop and the actions of a clip; calm clips have no actions."""
    rest = find_rest(motion)
    actions = find_actions(motion, rest)
    return Animation(motion.fps, len(motion.speeds), rest, actions)


def find_rest(motion: Motion) -> Rest:
    """The longest span in which the hands are calm, from one of their slowest frames to another.

    Calm is what is slower than the clip's division into slow and fast frames; where that leaves
    no span of `LEAST_REST`, the calmest one of that length is taken.
    """
    speeds = motion.speeds
    bound = max(CALM, _division(speeds))
    wanted = min(math.ceil(LEAST_REST * motion.fps), len(speeds) - 1)
    first, last = longest_run(speeds <= bound)
    if last - first < wanted:
        sums = np.convolve(speeds, np.ones(wanted + 1), "valid")
        first = int(np.argmin(sums))
        last = first + wanted
    part = int(ENDS * (last - first)) + 1
    start = first + int(np.argmin(speeds[first : first + part]))
    end = last - int(np.argmin(speeds[last - part + 1 : last + 1][::-1]))
    return Rest(start, end)


def find_actions(motion: Motion, rest: Rest) -> tuple[Action, ...]:
    """Frames at which the hands slow down away from rest, those that serve best first.

    The score is the product of how far the hands are from rest, next to the farthest; how much
    slower they are than around; and how alike the speeds before and after are, for then motion
    that turns back looks like motion that goes on.
    """
    from scipy.signal import find_peaks  # takes long to import

    dips, _ = find_peaks(-np.log(motion.speeds + 1e-4), prominence=np.log(DIP))
    spans = [_still_span(motion, int(dip)) for dip in dips]
    middles = {(first + last) // 2: (first, last) for first, last in spans}
    away = {
        frame: motion.away(frame, rest.end)
        for frame in middles
        if not rest.start <= frame <= rest.end
    }
    farthest = max(away.values(), default=0.0)
    actions = [
        Action(frame, round(away[frame] / farthest * _turns(motion, *middles[frame]), 3))
        for frame in away
        if away[frame] >= LEAST_AWAY
    ]
    return tuple(sorted(actions, key=lambda action: -action.score)[:MOST_ACTIONS])


def _still_span(motion: Motion, frame: int) -> tuple[int, int]:
    """First and last frame of a pose that is held, which may be one frame only."""
    still = motion.speeds <= max(CALM, motion.speeds[frame])
    moving = np.flatnonzero(~still)
    place = int(np.searchsorted(moving, frame))
    first = moving[place - 1] + 1 if place > 0 else 0
    last = moving[place] - 1 if place < len(moving) else len(still) - 1
    return int(first), int(last)


def _hands(step: np.ndarray) -> float:
    """Metres that the hands move in a step of the Gaussians (N, 3)."""
    moved = np.sort(np.linalg.norm(step, axis=1))  # (N,)
    first, last = (int(part * len(moved)) for part in FASTEST)
    return float(moved[first : max(last, first + 1)].mean())


def _division(speeds: np.ndarray) -> float:
    """The speed that divides slow from fast frames best: Otsu's threshold of the logarithms."""
    values = np.sort(np.log(speeds + 1e-4))
    if len(values) < 2:
        return float(speeds.max())
    below = np.arange(1, len(values))
    sums = np.cumsum(values)[:-1]
    means = sums / below, (values.sum() - sums) / (len(values) - below)
    between = below * (len(values) - below) * (means[1] - means[0]) ** 2
    index = int(np.argmax(between))
    return float(np.exp((values[index] + values[index + 1]) / 2))


def longest_run(calm: np.ndarray) -> tuple[int, int]:
    """First and last index of the longest stretch of True; of equal ones the first."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], calm, [False]])))
    runs = edges.reshape(-1, 2)  # begin, one after the end
    first, after = max(runs.tolist(), key=lambda run: run[1] - run[0], default=(0, 1))
    return first, after - 1


def _turns(motion: Motion, first: int, last: int) -> float:
    """How well motion turns at a pose that is held from frame to frame, 0 to 1."""
    speeds = motion.speeds
    reach = max(1, round(AROUND * motion.fps))
    reach = min(reach, first, len(speeds) - 1 - last)
    before, after = speeds[first - reach : first][::-1], speeds[last + 1 : last + 1 + reach]
    if reach == 0:
        return 0.0  # the clip begins or ends with it: nobody knows how it would go on
    unlike = np.abs(before - after).sum() / (before + after).sum()
    slow = speeds[first : last + 1].min() / max(before.max(), after.max())
    return float((1 - slow) * (1 - unlike))
