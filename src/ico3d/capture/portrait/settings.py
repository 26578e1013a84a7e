"""How a video becomes a portrait capture, and the steps of that."""

from dataclasses import dataclass

from ico3d.common.device import DeviceName
from ico3d.common.people.stated import NOT_STATED

FPS = 25.0
"""Pictures per second of a portrait capture."""
FACES, CUTOUTS, POSES = "finding the face", "cutting out the person", "refining the poses"
"""Names of the steps whose progress is told, in their order."""
VISITS = 25
"""Number of times that each frame is used while poses are corrected."""
STEPS = (2_000, 30_000)
"""Limits of the number of these steps: short clips need more visits per frame, long ones fewer."""


def steps_for(frames: int) -> int:
    """Number of steps by which the poses of so many frames are corrected."""
    least, most = STEPS
    return min(max(VISITS * frames, least), most)


@dataclass(frozen=True)
class PortraitSettings:
    """How a video becomes a portrait capture.

    Attributes:
        size: Upper limit of the pictures' short side in pixels; larger videos are scaled down.
        focal: Focal length in pixels of the original video; None to estimate it.
        refine: Whether to correct the poses by pictures of the whole head.
        likeness: Whose likeness it is: the person's name.
        consent: What the person agreed to, and how.
        licence: Licence of the recording.
        device: Where to correct the poses.
        most: Upper limit of the pictures that are kept, evenly spread over the video; None keeps
            all that show a face. Sound and blendshapes are those of the whole video.
    """

    size: int = 512
    focal: float | None = None
    refine: bool = True
    likeness: str = NOT_STATED
    consent: str = NOT_STATED
    licence: str = NOT_STATED
    device: DeviceName = "auto"
    most: int | None = None
