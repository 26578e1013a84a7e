"""Settings for importing recordings of other programs."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Literal

from ico3d.common.people.stated import NOT_STATED
from ico3d.errors import SettingsError


@dataclass(frozen=True)
class ImportSettings:
    """What an imported recording does not say itself.

    Attributes:
        images: Folder of a COLMAP model's pictures; by default a folder `images` nearby.
        fps: Frames per second, for recordings whose pictures have times.
        scale: Metres per unit of the source; COLMAP's unit is arbitrary.
        likeness: Who the person is; goes into the avatar's manifest, and ico3d forget finds by this
            name what belongs to the person.
        consent: What the person agreed to, and how; goes into the avatar's manifest.
        licence: Licence of the recording; goes into the avatar's manifest.
        shows: What fills the pictures: the whole body, or the head (for training a head).
    """

    images: Path | None = None
    fps: float = 25.0
    scale: float = 1.0
    likeness: str = NOT_STATED
    consent: str = NOT_STATED
    licence: str = NOT_STATED
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
