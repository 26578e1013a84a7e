"""Which motion of a body looks right: its pictures beside the recorded ones, part by part.

A forearm that dissolves in a quick gesture hardly changes the mean error of a whole person, so a
picture is as good as its worst part.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import groupby

import numpy as np
from scipy.ndimage import uniform_filter

from ico3d.avatar.animation.keyframes import longest_run
from ico3d.avatar.clip_views import At, View, drawn, measuring_cameras, recorded_view
from ico3d.avatar.moving import Span
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.capture.capture import Capture
from ico3d.common.psnr import decibels
from ico3d.common.spread import spread
from ico3d.errors import BundleError, CaptureError

FAR_BELOW = 2.0
"""dB below the clip's own quality from which a frame is not played."""
MOST_FRAMES, MOST_CAMERAS = 150, 4
"""That are looked at; quality between frames is interpolated."""
PART = 0.08
"""Side of the square that counts as one part, over the person's height in the picture."""
COVERED = 0.25
"""Share of such a square that the person must fill: fewer pixels are an outline."""
_FACE = 1.0 / 255
"""Difference between pictures with and without the head from which a pixel shows the head."""

Watch = Callable[[Iterable[int]], Iterable[int]]
"""Passes frames on and shows the progress."""


def measure_motion(
    whole: At, body: At | None, capture: Capture, clip: Span, watch: Watch = iter
) -> tuple[float, ...]:
    """PSNR in dB of the worst part of the body in each frame, mean over cameras.

    Args:
        whole: The person at τ of the whole clip.
        body: The same without its head, which moods and words move too: what shows the head is
            not judged. None where there is no head.
        capture: The body's recording. Its test cameras look, where it has some.
        clip: All frames that the person has, from 0.
        watch: Shows the progress.

    Returns:
        One value for each frame; none at all where the recording has no picture of them that a
        mask or a clean plate tells from what is behind.

    Raises:
        CaptureError: If it is the recording of another clip.
    """
    if capture.num_frames <= clip.last:
        raise CaptureError(
            f"{capture.path} is not the recording of this body: it has {capture.num_frames} "
            f"frames, the body {clip.last + 1}."
        )
    looking = measuring_cameras(capture)
    cameras = [looking[i] for i in spread(len(looking), MOST_CAMERAS)]
    looked = spread(clip.last + 1, MOST_FRAMES)
    values = np.full((len(looked), len(cameras)), np.nan)
    for row, frame in enumerate(watch(looked)):
        for column, camera in enumerate(cameras):
            view = recorded_view(capture, camera, frame, clip)
            if view is not None and _is_told(view):
                values[row, column] = _worst_part(whole, body, view)
    return _over_cameras(values, looked, clip.last + 1)


def _is_told(view: View) -> bool:
    """Whether a mask or a clean plate tells the person from what is behind."""
    return view.mask is not None or view.background.ndim == 3


def _over_cameras(values: np.ndarray, frames: list[int], count: int) -> tuple[float, ...]:
    """Means over cameras (S, C) at some frames, for all of `count` frames; may be none.

    Cameras see different sides, in other light: each is compared with its own median, so that a
    frame is no better or worse for which of them took it.
    """
    known = ~np.isnan(values)  # (S, C)
    values = values[:, known.any(axis=0)]  # (S, C'): cameras that took something
    some = known.any(axis=1)  # (S,)
    if not some.any():
        return ()
    usual = np.nanmedian(values, axis=0)  # (C',)
    means = np.nanmean(values[some] - usual, axis=1) + usual.mean()  # (S',)
    between = np.interp(np.arange(count), np.array(frames)[some], means)  # (count,)
    return tuple(round(float(value), 2) for value in between)


def least_quality(animation: Animation) -> float:
    """The dB that a frame must have to be played: not far below the clip's median."""
    return float(np.median(animation.quality)) - FAR_BELOW


def playable(animation: Animation) -> Animation:
    """What can be played without passing a frame whose picture falls far below the clip's.

    Motion goes along the recorded frames, so everything must lie in one stretch of good ones: the
    one that the rest loop is in, or the longest of those that it is cut into.

    Raises:
        BundleError: If no two neighbouring frames of the rest loop are good.
    """
    if not animation.quality:
        return animation
    good = np.array(animation.quality) >= least_quality(animation)  # (F,)
    rest = animation.rest
    first, last = longest_run(good[rest.start : rest.end + 1])
    if last <= first:
        raise BundleError(
            f"no stretch of the rest loop (frames {rest.start} to {rest.end}) looks nearly as good "
            "as the rest of the clip: train longer, or name another one in animation.json."
        )
    rest = Rest(rest.start + first, rest.start + last)
    bad = np.concatenate([[-1], np.flatnonzero(~good), [len(good)]])
    after = int(np.searchsorted(bad, rest.start))
    begin, end = bad[after - 1], bad[after]
    actions = tuple(action for action in animation.actions if begin < action.frame < end)
    return replace(animation, rest=rest, actions=actions)


def refused(proposed: Iterable[Action], played: Animation) -> tuple[Action, ...]:
    """Those of the proposed actions that are not played, each once, in the order of time."""
    kept = {action.frame for action in played.actions}
    left = {action.frame: action for action in proposed if action.frame not in kept}
    return tuple(left[frame] for frame in sorted(left))


def in_words(animation: Animation, left_out: int) -> str:
    """What was judged and what became of it, for people."""
    bound = least_quality(animation)
    bad = [frame for frame, value in enumerate(animation.quality) if value < bound]
    median = f"{bound + FAR_BELOW:.1f} dB in the worst part of a picture"
    if not bad:
        return f"all motion looks alike ({median})."
    worst = min(animation.quality)
    gestures = "1 gesture is" if left_out == 1 else f"{left_out} gestures are"
    return (
        f"frames {_spans(bad)} fall far below the clip's own quality ({worst:.1f} dB against "
        f"{median}): {gestures} not played."
    )


def _spans(frames: list[int]) -> str:
    """Ascending numbers as "3, 7 to 9"."""
    runs = groupby(enumerate(frames), lambda pair: pair[1] - pair[0])
    ends = [(run[0][1], run[-1][1]) for run in (list(group) for _, group in runs)]
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in ends)


def _worst_part(whole: At, body: At | None, view: View) -> float:
    """PSNR of the part that is worst; NaN where too little of the person is seen."""
    picture = drawn(whole, view)[0]  # (H, W, 3)
    assert view.truth is not None
    mask = np.ones(picture.shape[:2]) if view.mask is None else view.mask.astype(float)  # (H, W)
    rows = np.flatnonzero(mask.max(axis=1) > 0.5)
    if len(rows) == 0:
        return np.nan
    if body is not None:
        mask = mask * (np.abs(picture - drawn(body, view)[0]).max(axis=2) <= _FACE)
    side = max(3, round(PART * (rows[-1] + 1 - rows[0])))
    squares = np.square(picture - view.truth).mean(axis=2)  # (H, W)
    errors, weights = (uniform_filter(values, side) for values in (squares * mask, mask))
    parts = weights > COVERED
    if not parts.any():
        return np.nan
    return decibels(float((errors[parts] / weights[parts]).max()))
