"""Whether a recording has pictures for the frames that it claims, before anything counts on them.

A few digits can claim millions of frames; poses, splits and pictures that are looked for would
take gigabytes and minutes.
"""

from collections.abc import Iterable

from ico3d.errors import CaptureError

BELIEVED = 10_000
"""Number of frames that nobody counts pictures for."""
MOST_GAPS = 10
"""Largest number of frames of a recording, per frame that has a picture."""


def check_claimed(claimed: int, pictures: Iterable[int], what: str) -> None:
    """Refuses a recording that claims far more frames than it has pictures.

    Args:
        claimed: Number of frames.
        pictures: Numbers of pictures, as of cameras, which are asked for until they are enough.
        what: Name of the recording, or of the file that claims.

    Raises:
        CaptureError: If there are more than `BELIEVED`, and more than `MOST_GAPS` a picture.
    """
    if claimed <= BELIEVED:
        return
    there = 0
    for count in pictures:
        there += count
        if claimed <= MOST_GAPS * there:
            return
    raise CaptureError(
        f"{what} claims {claimed} frames and has {there} pictures: correct num_frames, or fetch "
        "the missing pictures."
    )
