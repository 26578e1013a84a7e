"""Writing a video file."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.common.files import write_atomic
from ico3d.errors import MissingExtraError

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

QUALITY = "18"
"""x264's constant rate factor: no difference to be seen."""
SOUND_RATE = 48_000
"""Samples per second of a film's sound: what players expect."""
SOUND_BITS = 128_000
"""Per second."""
BT709 = 1
"""Of H.264's tables: how colours are coded in video of today."""


def write_video(
    path: Path,
    pictures: Iterable[np.ndarray],
    size: tuple[int, int],
    fps: float,
    sound: Sound | None = None,
) -> None:
    """Writes an H.264 video, with AAC sound, that every browser plays.

    Args:
        path: The .mp4 file; it appears when all pictures are in it.
        pictures: (H, W, 3) uint8 RGB.
        size: Their width and height, even numbers.
        fps: Pictures per second.
        sound: What is heard from the first picture on.

    Raises:
        MissingExtraError: If PyAV is not installed.
    """
    try:
        import av  # noqa: F401
    except ModuleNotFoundError:
        raise MissingExtraError("av", "train", "writing videos") from None
    write_atomic(path, lambda temporary: _encode(temporary, pictures, size, fps, sound))


def _encode(
    path: Path,
    pictures: Iterable[np.ndarray],
    size: tuple[int, int],
    fps: float,
    sound: Sound | None,
) -> None:
    import av

    # faststart: a page can play the file before all of it has come.
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = _video_stream(container, size, fps)
        heard = None if sound is None else _SoundTrack(container, sound)
        for number, picture in enumerate(pictures, 1):
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            coded = frame.reformat(format="yuv420p", dst_colorspace=BT709)
            container.mux(stream.encode(coded))
            if heard is not None:
                heard.write_until(number / fps)
        container.mux(stream.encode(None))
        if heard is not None:
            heard.finish()


def _video_stream(container: "OutputContainer", size: tuple[int, int], fps: float) -> "VideoStream":
    rate = Fraction(fps).limit_denominator(1001)
    stream = container.add_stream("libx264", rate, options={"crf": QUALITY})
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.colorspace = context.color_primaries = context.color_trc = BT709
    return stream


class _SoundTrack:
    """Sound that is written along with the pictures, so that players need not look far ahead."""

    def __init__(self, container: "OutputContainer", sound: Sound):
        self._container, self._sound = container, sound
        self._stream = container.add_stream("aac", sound.rate, layout="mono")
        self._stream.bit_rate = SOUND_BITS
        self._written = 0

    def write_until(self, seconds: float) -> None:
        """Writes the sound up to a time of the film."""
        import av

        end = min(round(seconds * self._sound.rate), len(self._sound.samples))
        samples = self._sound.samples[None, self._written : end]  # (1, n)
        if samples.size == 0:
            return
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples), "fltp", "mono")
        frame.sample_rate, frame.pts = self._sound.rate, self._written
        frame.time_base = Fraction(1, self._sound.rate)
        self._container.mux(self._stream.encode(frame))
        self._written = end

    def finish(self) -> None:
        """Writes what is left."""
        self.write_until(len(self._sound.samples) / self._sound.rate)
        self._container.mux(self._stream.encode(None))
