"""Writes video files: H.264 pictures and AAC sound in MP4."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.common.files import check_left, write_atomic
from ico3d.errors import MissingExtraError

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

QUALITY = "18"
"""x264's constant rate factor, at which the loss is not visible."""
SOUND_RATE = 48_000
"""Samples per second of a film's sound: what players expect."""
SOUND_BITS = 128_000
"""Bits per second of the coded sound."""
BT709 = 1
"""Number of the colour space BT.709 in H.264's tables, which is that of high-definition video."""


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
        pictures: (H, W, 3) uint8 RGB pictures.
        size: Width and height of the pictures in pixels, even numbers.
        fps: Pictures per second.
        sound: Sound that begins with the first picture; None for a silent video.

    Raises:
        MissingExtraError: If PyAV is not installed.
        StorageError: If the disk becomes full; it is not filled to its last byte.
    """
    try:
        import av  # noqa: F401
    except ModuleNotFoundError:
        raise MissingExtraError("av", "train", "writing videos") from None

    def watched() -> Iterator[np.ndarray]:
        for picture in pictures:
            check_left(path.parent, path)
            yield picture

    write_atomic(path, lambda temporary: _encode(temporary, watched(), size, fps, sound))


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
    """Writes sound in step with the pictures, so that players find both close together."""

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
        """Writes the rest of the sound and closes the stream."""
        self.write_until(len(self._sound.samples) / self._sound.rate)
        self._container.mux(self._stream.encode(None))
