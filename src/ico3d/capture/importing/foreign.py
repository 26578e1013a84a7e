"""What recordings of other tools come down to before they become a multiview folder."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.decoding import size_of
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.files import PICTURES
from ico3d.errors import CaptureError

SAME_SHAPE = 0.01
"""Relative difference of aspect ratios that rounding may bring."""


@dataclass(frozen=True)
class Shot:
    """One picture.

    Attributes:
        file: Where it lies.
        lens: That of the picture, in the picture's size.
        camera_to_world: (4, 4) rigid, OpenCV axes, in units of the source.
        time: When it was taken, in any unit; None where all are of one moment.
        mask: A picture of the person's mask.
    """

    file: Path
    lens: Lens
    camera_to_world: np.ndarray
    time: float | None = None
    mask: Path | None = None


@dataclass(frozen=True)
class Foreign:
    """A recording of another tool.

    Attributes:
        tool: Its name.
        shots: All pictures.
        points: (P, 3) surface points of the first moment, in units of the source.
        axes_mean_up: Whether +y or +z of the source is meant to be up if it nearly is.
    """

    tool: str
    shots: list[Shot]
    points: np.ndarray | None
    axes_mean_up: bool


def inside(folder: Path, name: str, what: str) -> Path:
    """A file that another file names.

    Args:
        folder: Where it must lie, or below.
        name: Its path from there; of a picture the suffix may lack.
        what: Who names it, for the error.

    Raises:
        CaptureError: If it lies elsewhere, is missing, or is in no format read here.
    """
    root = folder.resolve()
    try:
        path = (root / name).resolve()
        found = next(p for p in (path, *_suffixed(path)) if p.is_file())
    except (StopIteration, OSError, ValueError, RuntimeError) as error:
        raise CaptureError(f"{what}: the picture {name!r} is missing in {folder}.") from error
    if not found.is_relative_to(root):
        raise CaptureError(f"{what}: the picture {name!r} lies outside {folder}.")
    if found.suffix.lower() not in PICTURES:
        raise CaptureError(f"{what}: {name!r} is no JPEG or PNG picture: convert it.")
    return found


def fitted(lens: Lens, file: Path) -> Lens:
    """A lens for a picture as it is; calibrations are often made at another size.

    Raises:
        CaptureError: If the picture is damaged or has another shape.
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
