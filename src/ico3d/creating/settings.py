"""What an avatar is made of, and how well."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.avatar.embodying.builds.names import MEDIUM, BuildName
from ico3d.avatar.embodying.look import AS_RECORDED, Look, OutfitName
from ico3d.common.device import DeviceName
from ico3d.common.people.stated import NOT_STATED
from ico3d.head.settings import PRESETS, HeadSettings

QualityName = Literal["quick", "good", "best"]

OWN_USE = "for this person's own use"
"""Licence of an avatar of which nothing else is said."""


@dataclass(frozen=True)
class CreateSettings:
    """What an avatar is made of.

    Attributes:
        video: A video of one person who talks, by a phone or a webcam that stands still.
        out: The avatar to write, NAME.ico3d; NAME is how it introduces itself.
        quality: How long to work on it: times for this machine are told before it starts.
        persona: TOML or JSON file that says who the avatar is; by default it knows its name alone.
        consent: What the person agreed to, and how; goes into the avatar's manifest, and without it
            nothing is made.
        licence: Licence under which the avatar may be used; goes into the avatar's manifest.
        made_by: Who makes the avatar; by default the person NAME.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
        voice_consent: What the person agreed to about their voice, and how. Then the avatar speaks
            with a voice cloned from the video, where OpenVoice is installed; goes into the avatar's
            manifest. Without it no voice is cloned.
        body: A whole person on a skeleton, whose body stands in for that of which the video shows
            nothing; `demo` is the avatar of the package. By default the avatar is a head alone.
        build: Build of that body; `medium` is the one that was recorded.
        outfit: Colours of its clothes; `recorded` are those that were.
    """

    video: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    quality: QualityName = "good"
    persona: Path | None = None
    consent: str = NOT_STATED
    licence: str = OWN_USE
    made_by: str = ""
    device: DeviceName = "auto"
    voice_consent: str = ""
    body: Path | None = None
    build: BuildName = MEDIUM
    outfit: OutfitName = AS_RECORDED

    @property
    def look(self) -> Look:
        """How the body is to look."""
        return Look(self.build, self.outfit)


@dataclass(frozen=True)
class Quality:
    """How much work goes into an avatar.

    Attributes:
        tracking: Name of the way the video is tracked; qualities that share it share its result.
        pictures: Most pictures that are kept of the video.
        refine: Whether poses are corrected by pictures of the whole head.
        head: How the head is trained.
    """

    tracking: str
    pictures: int
    refine: bool
    head: HeadSettings


_CPU = replace(PRESETS["cpu"], smile=True)
QUALITIES: dict[QualityName, Quality] = {
    "quick": Quality(
        "rough",
        200,
        False,
        replace(
            _CPU,
            steps=600,
            checkpoint_every=100,
            density=replace(_CPU.density, begin=100, until=400),
        ),
    ),
    "good": Quality("exact", 300, True, replace(_CPU, checkpoint_every=250)),
    "best": Quality("exact", 300, True, replace(_CPU, steps=6_000, checkpoint_every=250)),
}
