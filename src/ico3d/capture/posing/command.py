"""The command `ico3d capture pose`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

MOST_WORKERS = 8
"""Most threads by default: each needs memory for a large picture and two models."""


@dataclass(frozen=True)
class Pose:
    """Fit a skeleton and a body's surface to the person in a recording.

    MediaPipe finds body and hands in the pictures of the training cameras. The points on which
    cameras agree, or the recording's own key points where it has some, place the joints of an open
    body model (Anny); the masks correct its surface. The result is body_track.safetensors, in the
    recording's folder or beside the recording's file; each run writes it anew.

    A recording that brings SMPL-X parameters (DNA-Rendering) needs no fit if you have SMPL-X's
    model file, whose licence is non-commercial: skeleton and surface are then SMPL-X's.

    Attributes:
        capture: A recording of any format; a single camera tells little about depth.
        workers: Number of threads that read pictures.
        smplx_model: Your file SMPLX_MALE.npz, SMPLX_FEMALE.npz or SMPLX_NEUTRAL.npz, whichever the
            recording's parameters belong to; None for the file of that name in the folder
            ICO3D_MODELS, or a fit where there is none.
    """

    capture: Annotated[Path, tyro.conf.Positional]
    workers: int = field(default_factory=lambda: min(os.cpu_count() or 1, MOST_WORKERS))
    smplx_model: Path | None = None

    def run(self) -> None:
        """Finds skeleton and poses, writes the body track, and prints how well it fits.

        Raises:
            CaptureError: If no skeleton can be fitted, a model file of SMPL-X cannot be used, or
                the track cannot be written.
            MissingExtraError: If anny, MediaPipe or SciPy is not installed.
            MissingModelError: If a model file of MediaPipe, or the one that the user names, is
                missing.
            SettingsError: If `smplx_model` does not fit the recording.
        """
        from ico3d.errors import MissingExtraError

        try:
            from ico3d.capture.posing.report import say
            from ico3d.capture.posing.smplx.choosing import chosen_model
            from ico3d.capture.posing.smplx.track import track_from_parameters
            from ico3d.capture.posing.tracking import track_body
        except ModuleNotFoundError as error:
            raise MissingExtraError(error.name or "scipy", "train", "fitting a skeleton") from None
        from ico3d.capture.formats import open_capture
        from ico3d.rig.body_track import write_body_track

        recording = open_capture(self.capture)
        model = chosen_model(recording, self.smplx_model)
        if model is None:
            found = track_body(self.capture, self.workers)
        else:
            found = track_from_parameters(recording, model)
        say(found, write_body_track(found.track, recording.path))
