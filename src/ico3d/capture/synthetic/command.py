"""The command `ico3d capture synthetic`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.errors import MissingExtraError


@dataclass(frozen=True)
class Synthetic:
    """Records a synthetic person who talks, with exact truth for everything.

    The person speaks with espeak-ng's voice; lips, lids, brows and the sway of the body follow.
    The same settings write the same files.
    """

    out: Annotated[Path, tyro.conf.Positional]
    """Folder to write."""
    subject: str = "anny"
    """`anny` (the open body model, pip install 'ico3d[synthetic]') or an .npz subject file."""
    rig: Literal["head", "bust"] = "head"
    """Camera rig, a frontal arc: `head` fills the picture with it, `bust` shows the shoulders."""
    cameras: int = 6
    """How many cameras; the first looks straight at the face."""
    frames: int = 1100
    """How many frames at 25 per second; the last 1/11 are the test frames."""
    views_per_frame: int = 1
    """How many cameras take each frame: many expressions seen once teach a head more than few
    seen often."""
    size: int = 256
    """Width and height of the pictures in pixels."""
    text: str = ""
    """What is said, repeated as long as needed; by default varied English sentences."""
    lively: bool = True
    """Also show moods and glances; without, the face does nothing but speak, blink and raise brows,
    which is what a head driven by speech can know."""
    seed: int = 0
    """Decides voice, order of sentences, blinks, brows, sway and views."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Threads that draw."""

    def run(self) -> None:
        """Records and says where the capture lies."""
        from rich import print as say

        try:
            from ico3d.capture.synthetic.recording import Recording, record
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                error.name or "numba", "train", "recording synthetic people"
            ) from None

        recording = Recording(
            self.subject,
            self.rig,
            self.cameras,
            self.frames,
            self.views_per_frame,
            self.size,
            self.text,
            self.seed,
            self.lively,
        )
        record(recording, self.out, self.workers)
        say(f"{self.frames} frames by {self.cameras} cameras lie in {self.out}")
