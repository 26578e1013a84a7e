"""Writing a video file."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np

from ico3d.common.files import write_atomic
from ico3d.errors import MissingExtraError

QUALITY = "18"
"""x264's constant rate factor: no difference to be seen."""
BT709 = 1
"""Of H.264's tables: how colours are coded in video of today."""


def write_video(
    path: Path, pictures: Iterable[np.ndarray], size: tuple[int, int], fps: float
) -> None:
    """Writes an H.264 video that every browser plays.

    Args:
        path: The .mp4 file; it appears when all pictures are in it.
        pictures: (H, W, 3) uint8 RGB.
        size: Their width and height, even numbers.
        fps: Pictures per second.

    Raises:
        MissingExtraError: If PyAV is not installed.
    """
    try:
        import av  # noqa: F401
    except ModuleNotFoundError:
        raise MissingExtraError("av", "train", "writing videos") from None
    write_atomic(path, lambda temporary: _encode(temporary, pictures, size, fps))


def _encode(path: Path, pictures: Iterable[np.ndarray], size: tuple[int, int], fps: float) -> None:
    import av

    # faststart: a page can play the file before all of it has come.
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        rate = Fraction(fps).limit_denominator(1001)
        stream = container.add_stream("libx264", rate, options={"crf": QUALITY})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = BT709
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            coded = frame.reformat(format="yuv420p", dst_colorspace=BT709)
            container.mux(stream.encode(coded))
        container.mux(stream.encode(None))
