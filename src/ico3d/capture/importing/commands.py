"""The commands that make and complete multiview folders."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from ico3d.capture.importing.settings import ImportSettings

MOST_WORKERS = 8
"""Each needs room for some large pictures."""


def _workers() -> int:
    return min(os.cpu_count() or 1, MOST_WORKERS)


@dataclass(frozen=True)
class Import:
    """Take over a recording that COLMAP, nerfstudio or instant-ngp calibrated.

    Pictures are copied as they are into a multiview folder; lenses with distortion are straightened
    when it is read. The world is turned so that +y is up. Pictures without times become cameras of
    one moment.

    Attributes:
        source: A COLMAP sparse model (binary or text) or a folder around one, or transforms.json.
        out: Folder to make.
        settings: How the recording is taken over.
    """

    source: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    settings: Annotated[ImportSettings, tyro.conf.arg(name="")] = field(
        default_factory=ImportSettings
    )

    def run(self) -> None:
        """Runs it.

        Raises:
            CaptureError: If the source is damaged or not known, or `out` exists.
        """
        from ico3d.capture.importing.recording import import_recording

        about = import_recording(self.source, self.out, self.settings)
        _say(about, self.out)


@dataclass(frozen=True)
class Masks:
    """Cut the person out of every picture of a multiview folder by its clean plates.

    Writes `masks/CAMERA/FRAME.png`; masks that are there stay, so that one can be mended by hand
    and an interrupted run goes on.

    Attributes:
        folder: A multiview folder with `backgrounds/CAMERA.png`.
        workers: Threads.
    """

    folder: Annotated[Path, tyro.conf.Positional]
    workers: int = field(default_factory=_workers)

    def run(self) -> None:
        """Runs it.

        Raises:
            CaptureError: If there is no clean plate, or a picture is damaged.
        """
        from rich import print as say

        from ico3d.capture.multiview.masks import make_masks

        written = make_masks(self.folder, self.workers)
        say(f"{written} masks written; look at them: ico3d capture check {self.folder}")


@dataclass(frozen=True)
class Resize:
    """Write any capture again with smaller pictures, as a multiview folder.

    Recordings of 5 or 12 megapixels are decoded, corrected and straightened once instead of at each
    look. Keeps pictures, masks, clean plates, sound, surface points and the tracked head of a
    multiview folder.

    Attributes:
        source: A capture of any format.
        out: Folder to make.
        height: Pixels that pictures have at most.
        workers: Threads.
    """

    source: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    height: int = 512
    workers: int = field(default_factory=_workers)

    def run(self) -> None:
        """Runs it.

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
