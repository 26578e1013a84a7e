"""Which motion of a body looks right: renderings are compared with recorded pictures.

A forearm that dissolves in a quick gesture hardly changes the mean error of a whole person, so the
quality of a picture is that of its worst part.
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
"""A frame is not played if its quality is more than this many dB below the clip's median."""
MOST_FRAMES, MOST_CAMERAS = 150, 4
"""Most frames and cameras that are compared; quality between these frames is interpolated."""
PART = 0.08
"""Side of the square that is judged as one part, relative to the person's height in the picture."""
COVERED = 0.25
"""Share of a part that the person must fill to be judged: with less it shows only an outline."""
_FACE = 1.0 / 255
"""Difference of renderings with and without the head above which a pixel shows the head."""

Watch = Callable[[Iterable[int]], Iterable[int]]
"""Passes an iterable of frames on and shows the progress."""


def measure_motion(
    whole: At, body: At | None, capture: Capture, clip: Span, watch: Watch = iter
) -> tuple[float, ...]:
    """PSNR in dB of the worst part of the body in each frame, mean over cameras.

    Args:
        whole: Returns the whole person at τ in [0, 1] of the clip.
        body: Returns the person without its head; None where there is no head. Pixels that show
            the head are not judged, as speech and moods move the face, too.
        capture: The body's recording. Pictures of its test cameras are compared, or of all cameras
            where it has no test cameras.
        clip: All frames of the person, from 0.
        watch: Shows the progress.

    Returns:
        One value in dB for each frame; empty where no picture could be compared, as a mask or a
        clean background is needed.

    Raises:
        CaptureError: If the recording has fewer frames than the clip.
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
    """Whether a mask or a clean background tells the person from what is behind."""
    return view.mask is not None or view.background.ndim == 3


def _over_cameras(values: np.ndarray, frames: list[int], count: int) -> tuple[float, ...]:
    """Mean quality over cameras, interpolated to all frames.

    Cameras see different sides in different light: the deviation from each camera's own median is
    averaged, so that a frame is not judged by which cameras have a picture of it.

    Args:
        values: (S, C) dB of S frames and C cameras; NaN where there is none.
        frames: The S frames.
        count: Number of all frames.

    Returns:
        `count` values in dB; empty where all are NaN.
    """
    known = ~np.isnan(values)  # (S, C)
    values = values[:, known.any(axis=0)]  # (S, C'): cameras with a value
    some = known.any(axis=1)  # (S,): frames with a value
    if not some.any():
        return ()
    usual = np.nanmedian(values, axis=0)  # (C',)
    means = np.nanmean(values[some] - usual, axis=1) + usual.mean()  # (S',)
    between = np.interp(np.arange(count), np.array(frames)[some], means)  # (count,)
    return tuple(round(float(value), 2) for value in between)


def least_quality(animation: Animation) -> float:
    """Least quality in dB with which a frame is played: `FAR_BELOW` under the clip's median."""
    return float(np.median(animation.quality)) - FAR_BELOW


def playable(animation: Animation) -> Animation:
    """The part of an animation that is played without passing a frame of bad quality.

    Playback passes through all frames between two key frames, so the rest loop and all actions must
    lie in one run of good frames. The rest loop is shortened to its longest run of good frames;
    actions outside the run of good frames around it are dropped. Without measured quality the
    animation is returned as it is.

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
    """The proposed actions that are not played, one for each frame, in order of time."""
    kept = {action.frame for action in played.actions}
    left = {action.frame: action for action in proposed if action.frame not in kept}
    return tuple(left[frame] for frame in sorted(left))


def in_words(animation: Animation, left_out: int) -> str:
    """A sentence for people about an animation's quality.

    Args:
        animation: With measured quality.
        left_out: Number of gestures that are not played.
    """
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
    """Ascending frames in words, such as "3, 7 to 9"."""
    runs = groupby(enumerate(frames), lambda pair: pair[1] - pair[0])
    ends = [(run[0][1], run[-1][1]) for run in (list(group) for _, group in runs)]
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in ends)


def _worst_part(whole: At, body: At | None, view: View) -> float:
    """PSNR in dB of the worst part of a picture; NaN where too little of the person is seen."""
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
