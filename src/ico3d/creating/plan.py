"""How long an avatar takes on this machine, and how much room."""

import shutil
from pathlib import Path

from ico3d.capture.portrait.settings import CUTOUTS, FACES, FPS, POSES, steps_for
from ico3d.creating.events import Step
from ico3d.creating.settings import Quality
from ico3d.errors import StorageError

FACE, COLOURS, CUTOUT = 0.7, 160.0, 4.0
"""Work of reading a face, of learning the colours by which people are cut out, and of cutting one
out, as multiples of the step that `set_pace` times (seconds of one core by seconds of one core)."""
REFINE = 1.5
"""Work of a step that corrects a pose, in the same unit: 20 to 40 ms where the unit is 20."""
LEARN, COMPARE = 9.2, 2.0
"""Work of a step that learns, and of a picture that is compared, in the same unit, measured."""
BYTES = 1.07
"""Bytes that a pixel of a kept picture takes with all that belongs to it, measured."""
SPARE = 0.4e9
"""Bytes that are to be free for everything else: checkpoints, previews, the avatar."""


def pictures_of(quality: Quality, seconds: float) -> int:
    """Number of pictures that are kept of a video of so many seconds."""
    return min(quality.pictures, round(seconds * FPS))


def expected(quality: Quality, seconds: float, step: float) -> dict[Step, float]:
    """Seconds that the steps from a video to an avatar will take, but for baking at the end.

    Args:
        quality: How much work goes into it.
        seconds: Length of the video.
        step: Seconds of one step of the standard size.
    """
    pictures = pictures_of(quality, seconds)
    return {
        "track": step * sum(_tracking(quality, seconds).values()),
        "learn": step * LEARN * quality.head.steps,
        "measure": step * COMPARE * pictures / 11,
    }


def tracking_spans(quality: Quality, seconds: float) -> dict[str, tuple[float, float]]:
    """Which share of tracking each of its steps begins and ends with, by the work that it is.

    Args:
        quality: How much work goes into it.
        seconds: Length of the video.
    """
    works = _tracking(quality, seconds)
    whole, done, spans = sum(works.values()), 0.0, {}
    for name, work in works.items():
        spans[name] = (done / whole, (done + work) / whole)
        done += work
    return spans


def _tracking(quality: Quality, seconds: float) -> dict[str, float]:
    """Work of the steps of tracking, as multiples of the standard step, in their order."""
    pictures = pictures_of(quality, seconds)
    return {
        FACES: FACE * seconds * FPS,
        CUTOUTS: COLOURS + CUTOUT * pictures,
        POSES: REFINE * steps_for(pictures) if quality.refine else 0.0,
    }


def check_room(folder: Path, quality: Quality, seconds: float, pixels: int) -> None:
    """Refuses to begin what a disk cannot hold of a video.

    Pictures of people are meant; what takes more, such as noise, ends once the disk is nearly full.

    Args:
        folder: A folder on the disk.
        quality: How much work goes into it.
        seconds: Length of the video.
        pixels: Of each picture, as it is kept.

    Raises:
        StorageError: If there is too little room.
    """
    everything = seconds * FPS  # all pictures lie there until some are chosen
    pictures = max(everything / 2, pictures_of(quality, seconds))
    needed = BYTES * pixels * pictures + SPARE
    free = shutil.disk_usage(folder).free
    if free < needed:
        sizes = {"free": round(free / 1e9, 1), "needed": round(needed / 1e9, 1)}
        raise StorageError.of("disk-room", f"{folder}: ", " Run the same command again.", sizes)
