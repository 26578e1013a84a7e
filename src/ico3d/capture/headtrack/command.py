"""The command `ico3d capture track`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

MOST_WORKERS = 8
"""Upper limit of the default number of threads; each holds a large picture and a face model."""
MOST_GAPS = 5
"""Number of gaps that the report lists."""


@dataclass(frozen=True)
class Track:
    """Find the head in a multiview recording: its pose, landmarks, eyes and blendshapes.

    MediaPipe finds the face in every camera that sees it. What the cameras agree on becomes one
    rigid head that moves through the recording. The result is written to tracking.safetensors in
    the recording's folder, or beside the recording's file, and replaces an earlier one. From then
    on the recording is opened with that head.

    Attributes:
        folder: A recording by several cameras, of any format.
        check: Also draw a contact sheet to this file, .jpg or .png.
        workers: Number of threads.
    """

    folder: Annotated[Path, tyro.conf.Positional]
    check: Path | None = None
    workers: int = field(default_factory=lambda: min(os.cpu_count() or 1, MOST_WORKERS))

    def run(self) -> None:
        """Tracks the head, writes the file and prints a report.

        Raises:
            CaptureError: If no two cameras see a face, or the folder is not writable.
            MissingExtraError: If MediaPipe or SciPy is not installed.
            MissingModelError: If MediaPipe's face model is not installed.
            SettingsError: If the contact sheet's name has another suffix.
        """
        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.capture.headpose.track_file import check_writable
        from ico3d.capture.headtrack.sheet import check_name, write_sheet
        from ico3d.errors import MissingExtraError

        try:
            from ico3d.capture.headtrack.tracker import track_head
        except ModuleNotFoundError as error:
            raise MissingExtraError(error.name or "scipy", "train", "tracking a head") from None

        capture = open_capture(self.folder)
        if self.check is not None:
            check_name(self.check)
        check_writable(capture.path)
        track, report = track_head(self.folder, self.workers)
        written = track.write(capture.path)
        if self.check is not None:
            write_sheet(capture, track, self.check)
        say = Console(stderr=True).print
        say(
            f"{report.tracked} of {report.num_frames} frames tracked by {report.views:.1f} cameras "
            f"on average, reprojection error {report.reprojection:.2f} px: {written}"
        )
        if report.gaps:
            runs = [f"{a}" if a == b else f"{a}-{b}" for a, b in report.gaps[:MOST_GAPS]]
            more = ", …" if report.gaps[MOST_GAPS:] else ""
            say(f"[yellow]warning:[/] frames {', '.join(runs)}{more} are interpolated.")
