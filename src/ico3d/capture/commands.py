"""The verbs `ico3d capture portrait` and `ico3d capture check`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.common.device import DeviceName
from ico3d.common.people.stated import NOT_STATED


@dataclass(frozen=True)
class Portrait:
    """Track a talking-head video: poses, expressions, masks, background, sound.

    The camera should stand still and one person face it. Pictures are resampled to 25 per second
    and scaled down to at most `size`. The result is a folder in the talking-portrait layout.

    Attributes:
        video: The video file.
        out: Folder to make.
        intrinsics: Focal length in pixels of the video, or "estimated".
        size: Upper limit of the pictures' short side in pixels.
        refine: Correct the poses by pictures of the whole head, which takes a minute or more.
        likeness: Who the person is; goes into the avatar's manifest, and ico3d forget finds by this
            name what belongs to the person.
        consent: What the person agreed to, and how: "agreed in writing on 2026-11-24 to …"; goes
            into the avatar's manifest.
        licence: Licence of the recording; goes into the avatar's manifest.
        device: Where to correct the poses: by default CUDA where that works, else the CPU.
    """

    video: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    intrinsics: float | Literal["estimated"] = "estimated"
    size: int = 512
    refine: bool = True
    likeness: str = NOT_STATED
    consent: str = NOT_STATED
    licence: str = NOT_STATED
    device: DeviceName = "auto"

    def run(self) -> None:
        """Tracks the video and writes the folder."""
        from ico3d.capture.portrait.settings import PortraitSettings
        from ico3d.capture.portrait.track import track_portrait

        focal = None if self.intrinsics == "estimated" else self.intrinsics
        stated = (self.likeness, self.consent, self.licence)
        settings = PortraitSettings(self.size, focal, self.refine, *stated, self.device)
        track_portrait(self.video, self.out, settings)


@dataclass(frozen=True)
class Check:
    """Examine a capture of any format, and draw a contact sheet.

    The exit status is 1 if there is an error; warnings leave it 0.

    Attributes:
        path: The capture, a folder or a file.
        out: The contact sheet, a PNG; by default `check.png` inside the capture's folder, or beside
            the capture's file.
    """

    path: Annotated[Path, tyro.conf.Positional]
    out: Path | None = None

    def run(self) -> None:
        """Prints the findings and draws the contact sheet.

        Raises:
            CaptureError: If there is an error; the sentence is the first one.
        """
        from ico3d.capture.checking.check import report
        from ico3d.capture.formats import open_capture

        inside = self.path / "check.png"
        report(
            open_capture(self.path),
            self.out or (inside if os.path.isdir(self.path) else self.path.with_suffix(".png")),
        )
