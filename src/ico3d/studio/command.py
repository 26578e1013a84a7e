"""The command `ico3d capture synthetic`."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.errors import MissingExtraError


@dataclass(frozen=True)
class Synthetic:
    """Records a synthetic person who talks, with exact ground truth for everything.

    The person speaks with a voice of espeak-ng; lips, lids, brows and the sway of the body follow
    the speech. The same settings write the same files.
    """

    out: Annotated[Path, tyro.conf.Positional]
    """Folder to write."""
    subject: str = "anny"
    """`anny` (the open body model, pip install 'ico3d[synthetic]') or an .npz subject file."""
    rig: Literal["head", "bust", "body"] = "head"
    """Arrangement of the cameras: a frontal arc that shows the head (`head`) or head and
    shoulders (`bust`), or rings all around the whole person (`body`)."""
    cameras: int = 6
    """Number of cameras; the first stands in front."""
    near_cameras: int = 0
    """How many of the cameras of a whole person, the last ones, stand before the upper body and
    show it alone, 2.6 times as large."""
    frames: int = 1100
    """Number of frames; for a head, the last 1/11 are test frames."""
    fps: float = 25.0
    """Frames per second."""
    views_per_frame: int | None = None
    """Number of cameras that record each frame; by default one for heads (many expressions seen
    once teach a head more than few seen often) and all for bodies."""
    size: int = 256
    """Height of the pictures in pixels. Pictures of heads are square, those of bodies narrower."""
    text: str = ""
    """Text to say, repeated as long as needed; by default varied English sentences."""
    lively: bool = True
    """Also show moods and glances. Without this the face only speaks, blinks and raises brows,
    which is all that a head driven by speech can know."""
    light: Literal["studio", "soft", "warm"] = "studio"
    """Neutral lamps (`studio`), the same through wide cloths (`soft`), or warm lamps from the
    other side (`warm`); the light becomes part of the recorded colours."""
    motion: Literal["showcase", "talk", "walk", "sway", "repertoire", "conversation"] = "talk"
    """What a whole person does: `talk` stands and gestures in turn; `walk` walks in place;
    `repertoire` takes hands, head and chest through what they do in conversations, and walks;
    `conversation` does the same after making each gesture that avatars make; `showcase` stands
    calmly, gestures and moves fast, a third of the time each; `sway` does the same and turns the
    hips."""
    garment: Literal["none", "skirt"] = "none"
    """What a whole person wears over the clothes: a `skirt` hangs, folds and swings, and the
    arms keep off it."""
    clothes: Literal["plain", "patterned"] = "plain"
    """What the person wears: a knitted jumper, jeans and leather shoes (`plain`), or prints that
    show from metres away (`patterned`), for tests of tracking."""
    gaze: Literal["visitor", "ahead"] = "visitor"
    """Where the person looks between glances: at who stands before the first camera, whatever the
    head does (`visitor`), or where the head points (`ahead`)."""
    manner: Literal["neutral", "friendly", "smiling", "beaming"] = "neutral"
    """How the face is all the time, whatever it says: as it is (`neutral`), with a slight smile of
    mouth and eyes (`friendly`), or with one that comes and goes (`smiling`)."""
    traits: tuple[Literal["glasses", "beard", "long-hair", "dark-skin", "child"], ...] = ()
    """What the person has, for heads: glasses, a full beard, long loose hair, dark skin, or, with
    the subject `anny`, a child's head."""
    faults: tuple[Literal["noise", "exposure", "compression", "shutter", "drops"], ...] = ()
    """Also write `webcam.mp4`: what a webcam in the place of the first camera makes of it, with
    such faults. Noise that grows with darkness, exposure and white balance that wander, hasty
    compression, rows that are read one after the other, 15 pictures per second for some seconds."""
    seed: int = 0
    """Seed of voice, order of sentences, blinks, brows, sway, gestures and choice of cameras."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Number of threads that draw pictures."""

    def run(self) -> None:
        """Records, and prints where the capture lies.

        Raises:
            MissingExtraError: If a package that the studio needs is not installed.
        """
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
            self.clothes,
            self.gaze,
            self.manner,
            self.near_cameras,
            self.faults,
            self.traits,
        )
        record(recording, self.out, self.workers)
        say(f"{self.frames} frames by {self.cameras} cameras lie in {self.out}")
