"""What `create` tells while it works, for a terminal or a page to show."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ico3d.creating.looking.advice import Advice
from ico3d.creating.looking.examine import Examination

Step = Literal["look", "track", "learn", "measure", "bake"]
STEPS: tuple[Step, ...] = ("look", "track", "learn", "measure", "bake")
"""The steps from a video to an avatar, in their order."""


@dataclass(frozen=True)
class Looked:
    """The video has been looked at; what would make it better is in the examination."""

    video: Path
    found: Examination


@dataclass(frozen=True)
class Voiced:
    """The person agreed to have their voice cloned, and it was, or could not be.

    Attributes:
        seconds: Seconds of speech from which it was cloned; 0 where it was not.
        why: Why it was not; None where it was.
    """

    seconds: float
    why: Advice | None = None


@dataclass(frozen=True)
class Planned:
    """How long what is left will take.

    Attributes:
        seconds: Expected seconds of tracking, learning and measuring; what is done already has 0.
        others: Expected seconds of all of these by quality, were everything to be done.
    """

    seconds: dict[Step, float]
    others: dict[str, float]


@dataclass(frozen=True)
class Advanced:
    """A step goes on.

    Attributes:
        step: Which.
        share: How much of it is done, 0 to 1.
        doing: What is being done, in words.
    """

    step: Step
    share: float
    doing: str


@dataclass(frozen=True)
class Preview:
    """The face as it is learnt.

    Attributes:
        share: How much of the learning is done, 0 to 1.
        picture: (H, 2·W, 3) uint8, recorded and learnt side by side.
    """

    share: float
    picture: np.ndarray


@dataclass(frozen=True)
class Measured:
    """How good the avatar is on pictures that it never saw.

    Attributes:
        face: PSNR in dB on face and hair, a mean over the pictures.
        mouth: PSNR in dB in the box around the mouth.
        pictures: Number of pictures that were compared.
    """

    face: float | None
    mouth: float | None
    pictures: int


@dataclass(frozen=True)
class Made:
    """The avatar is there.

    Attributes:
        bundle: Its file.
        strip: Picture that compares recorded, learnt and deployed.
        measured: How good it is.
        seconds: What this call took.
    """

    bundle: Path
    strip: Path
    measured: Measured
    seconds: float


Event = Looked | Voiced | Planned | Advanced | Preview | Measured | Made
Tell = Callable[[Event], None]
"""Is told what happens; called on the thread that works."""
