"""The verbs `ico3d capture import`, `ico3d capture masks` and `ico3d capture resize`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from ico3d.capture.importing.settings import ImportSettings

MOST_WORKERS = 8
"""Upper limit of the default number of threads; each needs memory for some large pictures."""


def _workers() -> int:
    return min(os.cpu_count() or 1, MOST_WORKERS)


@dataclass(frozen=True)
class Import:
    """Imports a recording that COLMAP, nerfstudio or instant-ngp has calibrated.

    Pictures are copied unchanged into a multiview folder; lens distortion is removed when they are
    read. The world is turned so that +y is up. Pictures without times become cameras of a single
    frame.

    Attributes:
        source: A COLMAP sparse model (binary or text) or a folder around one, or transforms.json.
        out: Folder to make.
        settings: What the source does not say itself.
    """

    source: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    settings: Annotated[ImportSettings, tyro.conf.arg(name="")] = field(
        default_factory=ImportSettings
    )

    def run(self) -> None:
        """Imports the recording and prints what was written.

        Raises:
            CaptureError: If the source is damaged or of an unknown kind, or `out` exists.
        """
        from ico3d.capture.importing.recording import import_recording

        about = import_recording(self.source, self.out, self.settings)
        _say(about, self.out)


@dataclass(frozen=True)
class Masks:
    """Cuts the person out of every picture of a multiview folder by means of clean plates.

    Writes `masks/CAMERA/FRAME.png`. Existing masks are kept, so that masks can be corrected by hand
    and an interrupted run can be continued.

    Attributes:
        folder: A multiview folder with `backgrounds/CAMERA.png`.
        workers: Number of threads.
    """

    folder: Annotated[Path, tyro.conf.Positional]
    workers: int = field(default_factory=_workers)

    def run(self) -> None:
        """Writes the missing masks.

        Raises:
            CaptureError: If the folder has no clean plate, or a picture is damaged.
        """
        from rich import print as say

        from ico3d.capture.multiview.masks import make_masks

        written = make_masks(self.folder, self.workers)
        say(f"{written} masks written; look at them: ico3d capture check {self.folder}")


@dataclass(frozen=True)
class Resize:
    """Copies a capture of any format with smaller pictures into a multiview folder.

    Pictures of 5 or 12 megapixels are then decoded, corrected and undistorted only once instead of
    at each use. Pictures, masks, clean plates, sound, surface points and the tracks of head
    and body are copied.

    Attributes:
        source: A capture of any format.
        out: Folder to make.
        height: Upper limit of the pictures' height in pixels.
        workers: Number of threads.
    """

    source: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    height: int = 512
    workers: int = field(default_factory=_workers)

    def run(self) -> None:
        """Writes the folder and prints what was written.

        Raises:
            CaptureError: If the source cannot be read, or `out` exists.
        """
        from ico3d.capture.importing.resizing import resize_capture

        _say(resize_capture(self.source, self.out, self.height, self.workers), self.out)


def _say(about, out: Path) -> None:
    """What was written, and what to do with it."""
    from rich import print as say

    say(
        f"{len(about.places)} cameras, {about.num_frames} frames lie in {out}; "
        f"look at them: ico3d capture check {out}"
    )
