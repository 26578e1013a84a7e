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
    rig: Literal["head", "bust", "body"] = "head"
    """Camera rig. Frontal arcs: `head` fills the picture with it, `bust` shows the shoulders; rings
    all around the whole person: `body`."""
    cameras: int = 6
    """How many cameras; the first stands in front."""
    frames: int = 1100
    """How many frames; of a head, the last 1/11 are the test frames."""
    fps: float = 25.0
    """Frames per second."""
    views_per_frame: int | None = None
    """How many cameras take each frame; by default one for heads (many expressions seen once teach
    a head more than few seen often) and all for bodies."""
    size: int = 256
    """Height of the pictures in pixels; those of heads are as wide, those of bodies narrower."""
    text: str = ""
    """What is said, repeated as long as needed; by default varied English sentences."""
    lively: bool = True
    """Also show moods and glances; without, the face does nothing but speak, blink and raise brows,
    which is what a head driven by speech can know."""
    light: Literal["studio", "warm"] = "studio"
    """Neutral lamps, or warm ones from the other side; they are baked into the pictures."""
    motion: Literal["showcase", "talk", "walk", "sway"] = "talk"
    """What a whole person does: `talk` stands and gestures in turn, `walk` walks in place,
    `showcase` is calm, gestures and moves fast, a third of the time each; `sway` also turns the
    hips."""
    garment: Literal["none", "skirt"] = "none"
    """What a whole person wears over the clothes: a `skirt` hangs, folds and swings; arms then keep
    off it."""
    seed: int = 0
    """Decides voice, order of sentences, blinks, brows, sway, gestures and views."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Threads that draw."""

    def run(self) -> None:
        """Records and says where the capture lies."""
        from rich import print as say

        try:
            from ico3d.studio.recording import Recording, record
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                error.name or "numba", "train", "recording synthetic people"
            ) from None

        views = self.views_per_frame
        if views is None:
            views = self.cameras if self.rig == "body" else 1
        recording = Recording(
            self.subject,
            self.rig,
            self.cameras,
            self.frames,
            self.fps,
            views,
            self.size,
            self.text,
            self.seed,
            self.lively,
            self.light,
            self.motion,
            self.garment,
        )
        record(recording, self.out, self.workers)
        say(f"{self.frames} frames by {self.cameras} cameras lie in {self.out}")
