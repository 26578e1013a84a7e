"""How long an avatar takes on this machine, and how much room."""

import shutil
from pathlib import Path

from ico3d.capture.portrait.photometric_poses import steps_for
from ico3d.capture.portrait.settings import FPS
from ico3d.creating.events import Step
from ico3d.creating.looking.examine import Examination
from ico3d.creating.settings import Quality
from ico3d.errors import StorageError

FACE, CUTOUT, REFINE, LEARN = 1.0, 6.0, 1.4, 3.6
"""Work on a picture whose face is read, on one that is cut out, on a step that corrects a pose, and
on one that learns: as multiples of the step that `pace` times (measured)."""
MEASURE, BAKE = 80.0, 800.0
"""Work of measuring an avatar and of baking it, in the same unit (measured)."""
BYTES = 0.28e6
"""Bytes that a kept picture of 512² pixels takes with all that belongs to it (measured)."""
SPARE = 0.4e9
"""Bytes for everything else: pictures that are not kept for long, checkpoints, the bundle."""


def pictures_of(quality: Quality, found: Examination) -> int:
    """Number of pictures that are kept of a video."""
    return min(quality.pictures, round(found.seconds * FPS))


def expected(quality: Quality, found: Examination, step: float) -> dict[Step, float]:
    """Seconds that each step from a video to an avatar will take.

    Args:
        quality: How much work goes into it.
        found: What is known of the video.
        step: Seconds of one step of the standard size.
    """
    pictures = pictures_of(quality, found)
    track = FACE * found.seconds * FPS + CUTOUT * pictures
    if quality.refine:
        track += REFINE * steps_for(pictures)
    return {
        "track": step * track,
        "learn": step * LEARN * quality.head.steps,
        "measure": step * MEASURE,
        "bake": step * BAKE,
    }


def check_room(folder: Path, quality: Quality, found: Examination) -> None:
    """Refuses to begin what a disk cannot hold.

    Raises:
        StorageError: If there is too little room.
    """
    everything = found.seconds * FPS  # all pictures lie there until some are chosen
    needed = BYTES * max(everything / 2, pictures_of(quality, found)) + SPARE
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise StorageError(
            f"the disk of {folder} has {free / 1e9:.1f} GB left and {needed / 1e9:.1f} GB are "
            "needed: free some space and run the same command again."
        )
