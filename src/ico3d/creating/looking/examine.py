"""Examines a video: can an avatar be made of it, and what would make it better?"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.video import Video, open_video, read_sound
from ico3d.common.files import check_regular
from ico3d.creating.looking.advice import Advice, spans_of
from ico3d.creating.looking.picture_checks import picture_advice
from ico3d.creating.looking.samples import sampled
from ico3d.creating.looking.sound_checks import sound_advice
from ico3d.errors import CaptureError

PHOTOGRAPHS = rb"\xff\xd8\xff|\x89PNG\r\n|GIF8|II\*\0|MM\0\*|RIFF....WEBP|BM....\0\0\0\0"
"""How files of pictures begin: JPEG, PNG, GIF, TIFF, WebP, BMP. None is opened: what is beside its
pixels may take fifty times its size."""
LEAST_SECONDS, FEW_SECONDS = 3.0, 20.0
"""Length of a video that is too short to learn from, and of one that is short."""
SLOW = 20.0
"""Pictures per second below which lips are seen too rarely."""
GAP = 0.25
"""Seconds without a picture from which on a video stands still."""


@dataclass(frozen=True)
class Examination:
    """What was found in a video.

    Attributes:
        seconds: Length of the video.
        rate: Pictures per second.
        pixels: Of each picture, scaled down as an avatar is made of it.
        advice: What would make it better, what stands in the way of an avatar first.
        hands_sought: Whether hands before the face were looked for.
    """

    seconds: float
    rate: float
    pixels: int
    advice: tuple[Advice, ...]
    hands_sought: bool

    @property
    def refused(self) -> tuple[Advice, ...]:
        """Why no avatar can be made of the video, if none can."""
        return tuple(one for one in self.advice if one.level == "refused")


def examine(path: Path, size: int, reached: Callable[[float], None]) -> Examination:
    """Examines a video.

    Args:
        path: The file.
        size: Upper limit of the pictures' short side in pixels.
        reached: Told which share is done, 0 to 1.

    Raises:
        CaptureError: If the file is no video, or a photograph.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not installed.
    """
    refuse_photograph(path)
    video = open_video(path, size)
    samples = sampled(video, reached)
    if video.decoded < 2:
        raise CaptureError.of("photograph", f"{path} is ")
    seconds = video.times[-1] - video.times[0]
    found = [
        *_of_file(video, seconds),
        *picture_advice(samples),
        *sound_advice(read_sound(path)),
    ]
    found.sort(key=lambda one: one.level != "refused")
    pixels = video.width * video.height
    return Examination(seconds, _rate(video), pixels, tuple(found), samples.hands_sought)


def refuse_photograph(path: Path) -> None:
    """Refuses a picture, which shows too little of a person.

    Raises:
        CaptureError: If the file is a picture.
    """
    try:
        check_regular(path)
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError:
        return  # opening it as a video tells why
    if re.match(PHOTOGRAPHS, begin, re.DOTALL):
        raise CaptureError.of("photograph", f"{path} is ")


def _rate(video: Video) -> float:
    """Pictures per second, as most of them follow one another."""
    return 1 / max(float(np.median(np.diff(video.times))), 1e-3)


def _of_file(video: Video, seconds: float) -> Iterator[Advice]:
    """Length, rate, gaps and damage."""
    if seconds < LEAST_SECONDS:
        yield Advice("length-short", "refused", {"seconds": round(seconds, 1)})
    elif seconds < FEW_SECONDS:
        yield Advice("length-few", "better", {"seconds": round(seconds)})
    if (rate := _rate(video)) < SLOW:
        yield Advice("rate-slow", "better", {"n": round(rate)})
    gaps = np.flatnonzero(np.diff(video.times) > GAP)
    if len(gaps):
        spans = spans_of([video.times[i] for i in gaps], 1.0)
        yield Advice("rate-gaps", "better", {}, spans)
    if video.damaged:
        yield Advice("file", "better", {"n": video.damaged})
