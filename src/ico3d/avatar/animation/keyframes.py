"""Finds where a body rests and at which frames its motion may turn around.

The paper picks these key frames by hand (section "Procedural Body Animation"). Here they follow
from the speed of the hands, which move most: a body rests where its hands are slow for long, and
its motion can turn around or be held where they slow down away from rest.
"""

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import KDTree

from ico3d.avatar.moving import MovingBody, check_moves
from ico3d.bundle.animation import ANIMATION, Action, Animation, Rest
from ico3d.common.files import read_small
from ico3d.errors import BundleError

SEEN = 0.1
"""Opacity above which a Gaussian counts."""
FASTEST = (0.9, 0.99)
"""Quantiles of speed between which Gaussians count as hands and forearms; above are strays."""
MOST_PLACES = 20_000_000
"""Most positions of a clip that are looked at; of more, only every second, third, … Gaussian."""
MOST_POINTS = 4000
"""Most Gaussians of a frame that are compared with the rest pose."""
CALM = 0.05
"""Speed in metres per second up to which hands always count as resting."""
LEAST_REST = 0.5
"""Least length in seconds of a rest loop, if the clip allows it."""
ENDS = 0.2
"""Share of a calm span, at either end, that is searched for the frame with the slowest hands."""
DIP = 1.5
"""Factor by which the hands must be faster before and after an action than in it."""
AWAY = 0.98
"""Quantile of the Gaussians' distances from the rest pose that is taken as that of the hands."""
LEAST_AWAY = 0.04
"""Distance of the hands from the rest pose, metres, from which a pose can be an action."""
AROUND = 0.3
"""Seconds before and after an action in which its motion is judged."""
MOST_ACTIONS = 24
"""Most actions that are kept; those with the best scores."""


@dataclass(frozen=True)
class Motion:
    """How a body moves through its clip of F frames.

    Attributes:
        fps: Frames per second.
        speeds: (F,) speed of the hands, metres per second: mean of the steps before and after.
        places: For each frame, (N, 3) positions of the visible Gaussians in the world, metres; N
            differs between windows.
    """

    fps: float
    speeds: np.ndarray
    places: tuple[np.ndarray, ...]

    @staticmethod
    def of(body: MovingBody, windows: Iterable[np.ndarray] | None = None) -> "Motion":
        """Measures the motion of a body.

        Args:
            body: The body; within a window its Gaussians keep their order.
            windows: What `window_places` yields for the body, wrapped by callers that show
                progress; by default it is called here.

        Raises:
            BundleError: If the clip has one frame.
        """
        check_moves(body)
        speeds, places = [], []
        for window in window_places(body) if windows is None else windows:
            speeds += [_hands(step) * body.fps for step in np.diff(window, axis=0)]
            places += list(window[1 if places else 0 :])
        steps = np.array(speeds)  # (F - 1,)
        padded = np.concatenate([steps[:1], steps, steps[-1:]])  # (F + 1,)
        return Motion(body.fps, (padded[:-1] + padded[1:]) / 2, tuple(places))

    def away(self, frame: int, rest: int) -> float:
        """Distance in metres of the hands at a frame from the pose at frame `rest`.

        Each Gaussian's distance is that to the nearest Gaussian of the other frame, so both frames
        may lie in different windows.
        """
        one, other = (self._thinned(number) for number in (frame, rest))
        return float(np.quantile(KDTree(other).query(one)[0], AWAY))

    def _thinned(self, frame: int) -> np.ndarray:
        return self.places[frame][:: len(self.places[frame]) // MOST_POINTS + 1]


@torch.no_grad()
def window_places(body: MovingBody) -> Iterator[np.ndarray]:
    """Positions of the visible Gaussians in each window's frames.

    Yields:
        (frames, N, 3) metres in the world for each window; all Gaussians where none is visible.
    """
    frames = sum(span.last - span.first + 1 for span in body.windows)
    for index, span in enumerate(body.windows):
        taus = np.linspace(0, 1, span.last - span.first + 1)
        opacities, means = torch.zeros(()), []
        for tau in taus:
            shown = body.window_gaussians(index, float(tau))
            some = slice(None, None, 1 + frames * len(shown.means) // MOST_PLACES)
            opacities = opacities + shown.opacities[some].cpu() / len(taus)  # (N,)
            means.append(shown.means[some].cpu().numpy())
        seen = opacities > SEEN if (opacities > SEEN).any() else opacities >= 0
        yield np.stack(means)[:, seen.numpy()]


def read_animation(folder: Path, body: MovingBody) -> Animation | None:
    """Reads `animation.json` of a model's folder; None where there is no such file.

    Raises:
        BundleError: If the file makes no sense, or belongs to another body.
    """
    file, frames = folder / ANIMATION, body.windows[-1].last + 1
    if not os.path.isfile(file):
        return None
    try:
        animation = Animation.from_bytes(read_small(file))
    except (OSError, BundleError) as error:
        raise BundleError(f"{folder}: {error}") from error
    if (animation.fps, animation.num_frames) != (body.fps, frames):
        raise BundleError(
            f"{file} is for a body of {animation.num_frames} frames at {animation.fps:g} per "
            f"second, but this one has {frames} at {body.fps:g}: delete it to find key frames anew."
        )
    return animation


def find_animation(motion: Motion) -> Animation:
    """Finds the rest loop and the actions of a clip; a calm clip has no actions."""
    rest = find_rest(motion)
    actions = find_actions(motion, rest)
    return Animation(motion.fps, len(motion.speeds), rest, actions)


def find_rest(motion: Motion) -> Rest:
    """The longest span in which the hands are calm, shortened to begin and end at slow frames.

    A frame is calm up to the speed that divides the clip into slow and fast frames best, or up to
    `CALM`. Where no calm span lasts `LEAST_REST`, the slowest span of that length is taken.
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
    """Frames at which the hands slow down away from rest, best scores first.

    The score, from 0 to 1, is a product of three factors: the distance of the hands from rest,
    relative to the farthest action; how much slower they are than before and after; and how alike
    the speeds before and after are, for then motion that turns back looks like motion that goes on.
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
    """First and last frame of the pose that is held around a frame; both may be that frame."""
    still = motion.speeds <= max(CALM, motion.speeds[frame])
    moving = np.flatnonzero(~still)
    place = int(np.searchsorted(moving, frame))
    first = moving[place - 1] + 1 if place > 0 else 0
    last = moving[place] - 1 if place < len(moving) else len(still) - 1
    return int(first), int(last)


def _hands(step: np.ndarray) -> float:
    """Mean distance in metres by which the hands move, from displacements (N, 3) of Gaussians."""
    moved = np.sort(np.linalg.norm(step, axis=1))  # (N,)
    first, last = (int(part * len(moved)) for part in FASTEST)
    return float(moved[first : max(last, first + 1)].mean())


def _division(speeds: np.ndarray) -> float:
    """Speed that divides slow from fast frames: Otsu's threshold of logarithms of speeds (F,)."""
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
    """First and last index of the longest run of True, the first of equally long ones.

    Without any True the result is (0, 0).
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], calm, [False]])))
    runs = edges.reshape(-1, 2)  # (R, 2): first index, and one after the last
    first, after = max(runs.tolist(), key=lambda run: run[1] - run[0], default=(0, 1))
    return first, after - 1


def _turns(motion: Motion, first: int, last: int) -> float:
    """How well motion can turn around at a pose held from frame `first` to `last`, 0 to 1."""
    speeds = motion.speeds
    reach = max(1, round(AROUND * motion.fps))
    reach = min(reach, first, len(speeds) - 1 - last)
    before, after = speeds[first - reach : first][::-1], speeds[last + 1 : last + 1 + reach]
    if reach == 0:
        return 0.0  # the clip begins or ends with the pose: there is no motion to compare
    unlike = np.abs(before - after).sum() / (before + after).sum()
    slow = speeds[first : last + 1].min() / max(before.max(), after.max())
    return float((1 - slow) * (1 - unlike))
