"""Recordings of other programs in a common form, before they become a multiview folder."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.decoding import size_of
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.files import PICTURES
from ico3d.common.files import LONGEST, resolved
from ico3d.errors import CaptureError

SAME_SHAPE = 0.01
"""Relative difference of aspect ratios up to which rounding is the explanation."""


@dataclass(frozen=True)
class Shot:
    """One picture of another program's recording.

    Attributes:
        file: Path of the picture.
        lens: Lens of the camera, for the size of the picture.
        camera_to_world: (4, 4) rigid pose, OpenCV axes, in units of the source.
        time: Time of the picture in any unit; None if all pictures show the same moment.
        mask: Path of the person's mask, or None.
    """

    file: Path
    lens: Lens
    camera_to_world: np.ndarray
    time: float | None = None
    mask: Path | None = None


@dataclass(frozen=True)
class Foreign:
    """A recording of another program.

    Attributes:
        tool: Name of the program.
        shots: All pictures.
        points: (P, 3) surface points of the first moment, in units of the source, or None.
        axes_mean_up: Whether the source's +y or +z is taken to be up if it nearly is.
    """

    tool: str
    shots: list[Shot]
    points: np.ndarray | None
    axes_mean_up: bool


def inside(folder: Path, name: str, what: str) -> Path:
    """The path of a file whose name another file states.

    Args:
        folder: The file must lie in this folder or below.
        name: Path relative to the folder; for pictures the suffix may be missing.
        what: Name of the file that states the name, for errors.

    Raises:
        CaptureError: If the file lies elsewhere, is missing, or has an unknown format.
    """
    root = resolved(folder)
    if len(name) > LONGEST:  # to resolve it would take the square of its parts
        raise CaptureError(f"{what}: no picture has a name of {len(name)} letters.")
    try:
        path = resolved(root / name)
        found = next(p for p in (path, *_suffixed(path)) if os.path.isfile(p))
    except (StopIteration, OSError, ValueError, RuntimeError) as error:
        raise CaptureError(f"{what}: the picture {name!r} is missing in {folder}.") from error
    if not found.is_relative_to(root):
        raise CaptureError(f"{what}: the picture {name!r} lies outside {folder}.")
    if found.suffix.lower() not in PICTURES:
        raise CaptureError(f"{what}: {name!r} is no JPEG or PNG picture: convert it.")
    return found


def take_once(file: Path, taken: set[Path], what: str) -> None:
    """Each picture belongs to one camera and one time; a copy for each would fill the disk.

    It is asked for before anything else is done for the picture: millions may name one.

    Args:
        file: The picture.
        taken: Those before it, to which it is added.
        what: Name of the file that lists them, for errors.

    Raises:
        CaptureError: If it is among them.
    """
    if file in taken:
        raise CaptureError(f"{what}: the picture {file} is listed twice.")
    taken.add(file)


def fitted(lens: Lens, file: Path) -> Lens:
    """A lens, rescaled to the actual size of a picture; calibrations often use another size.

    Raises:
        CaptureError: If the picture is damaged or has another aspect ratio.
    """
    width, height = size_of(file, str(file))
    if (width, height) == (lens.width, lens.height):
        return lens
    if abs(width * lens.height / (height * lens.width) - 1) > SAME_SHAPE:
        raise CaptureError(
            f"{file} has {width}x{height} pixels, its calibration {lens.width}x{lens.height}: "
            "they differ in shape."
        )
    return lens.resized(width, height)


def _suffixed(path: Path) -> list[Path]:
    """The names that a picture without suffix may mean."""
    return [path.with_name(path.name + suffix) for suffix in PICTURES]
