"""Settings of taking over other programs' recordings."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Literal

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class ImportSettings:
    """How a recording is taken over.

    Attributes:
        images: Folder of the pictures of a COLMAP model; `images` nearby by default.
        fps: Frames per second of recordings whose frames have a time.
        scale: Metres per unit of the source; COLMAP's worlds have any size.
        consent: What the person agreed to; goes into the avatar's manifest.
        licence: Licence of the recording; goes into the avatar's manifest.
        shows: What fills the pictures: the whole body, or the head, to train one on.
    """

    images: Path | None = None
    fps: float = 25.0
    scale: float = 1.0
    consent: str = "not stated"
    licence: str = "not stated"
    shows: Literal["body", "head"] = "body"

    def __post_init__(self):
        """Checks the numbers.

        Raises:
            SettingsError: If frame rate or scale are not above 0.
        """
        if not (isfinite(self.fps) and self.fps > 0 and isfinite(self.scale) and self.scale > 0):
            raise SettingsError(
                f"fps and scale must be above 0, not {self.fps:g} and {self.scale:g}."
            )
