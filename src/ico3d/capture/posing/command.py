"""The command `ico3d capture pose`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

MOST_WORKERS = 8
"""Each holds a large picture and two models."""


@dataclass(frozen=True)
class Pose:
    """Fit a skeleton and a body's surface to the person in a recording.

    MediaPipe reads body and hands in the cameras that train; what cameras agree on, or the
    recording's own key points where it has some, places the joints of an open body model (Anny),
    and the masks correct it. Writes body_track.safetensors into the folder, or beside the file,
    that holds the recording, anew at each run.

    Attributes:
        capture: A recording of any format; one camera alone tells little about depth.
        workers: Threads that look at pictures.
    """

    capture: Annotated[Path, tyro.conf.Positional]
    workers: int = field(default_factory=lambda: min(os.cpu_count() or 1, MOST_WORKERS))

    def run(self) -> None:
        """Runs it.

        Raises:
            CaptureError: If no skeleton can be fitted, or nothing can be written there.
            MissingExtraError: If anny, MediaPipe or SciPy is not installed.
            MissingModelError: If a model of MediaPipe's is not there.
        """
        from ico3d.errors import MissingExtraError

        try:
            from ico3d.capture.posing.report import say
            from ico3d.capture.posing.tracking import track_body
        except ModuleNotFoundError as error:
            raise MissingExtraError(error.name or "scipy", "train", "fitting a skeleton") from None
        from ico3d.capture.formats import open_capture
        from ico3d.rig.body_track import write_body_track

        recording = open_capture(self.capture).path
        found = track_body(self.capture, self.workers)
        say(found, write_body_track(found.track, recording))
