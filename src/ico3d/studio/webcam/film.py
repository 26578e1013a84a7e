"""The film that a webcam with faults makes of a recording."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.capture.portrait.exposure import displayed, linear
from ico3d.common.files import write_atomic
from ico3d.errors import MissingExtraError
from ico3d.studio.webcam.faults import (
    FaultName,
    Shown,
    dropping,
    noisy,
    random_of,
    rolled,
    swings,
)

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

BITS = 0.2
"""Bits for each pixel of each picture: what 640 × 480 at 25 Hz have at 1.5 Mbit/s."""
GOOD = {"crf": "6", "preset": "veryfast"}
"""x264's options for a film whose compression does not show."""
HASTY = {"preset": "ultrafast", "tune": "zerolatency"}
"""x264's options for a webcam's, which must not wait."""
SOUND_BITS = 128_000


@dataclass(frozen=True)
class Webcam:
    """How a webcam sees a recording.

    Attributes:
        shown: The film's pictures in the order of time.
        gains: (F, 3) factors of linear red, green and blue in each frame.
    """

    shown: tuple[Shown, ...]
    gains: np.ndarray

    def about(self, fps: float) -> bytes:
        """What it did, as JSON: time and frame of each picture, factors of each frame."""
        told = {
            "pictures": [[round(one.at / fps, 6), one.frame] for one in self.shown],
            "gains": self.gains.round(6).tolist(),
        }
        return json.dumps(told).encode()


def webcam_of(faults: Sequence[FaultName], frames: int, fps: float, seed: int) -> Webcam:
    """Which pictures a webcam takes of a recording, and how bright."""
    shown = [Shown(number, number) for number in range(frames)]
    gains = np.ones((frames, 3))
    if "drops" in faults:
        shown = dropping(frames, fps, random_of(seed, "drops"))
    if "exposure" in faults:
        gains = swings(frames, fps, random_of(seed, "exposure"))
    return Webcam(tuple(shown), gains)


def pictures_of(
    webcam: Webcam, faults: Sequence[FaultName], seed: int, load: Callable[[int], np.ndarray]
) -> Iterator[np.ndarray]:
    """The pictures of a webcam, before they are compressed.

    Args:
        webcam: Which, and how bright.
        faults: What else it does wrong.
        seed: Seed of all random choices.
        load: Returns the picture (H, W, 3) uint8 of a frame.

    Yields:
        (H, W, 3) uint8; the same array again where the film shows a picture again.
    """
    random, last, picture = random_of(seed, "noise"), len(webcam.gains) - 1, None
    before = None
    for one in webcam.shown:
        if before is None or one.frame != before:
            picture = load(one.frame)
            if "shutter" in faults:
                around = (load(max(one.frame - 1, 0)), load(min(one.frame + 1, last)))
                picture = rolled(around[0], picture, around[1])
            if "exposure" in faults or "noise" in faults:
                light = linear(picture / 255.0) * webcam.gains[one.frame]
                light = noisy(light, random) if "noise" in faults else light
                picture = (displayed(light) * 255 + 0.5).astype(np.uint8)
            before = one.frame
        assert picture is not None
        yield picture


def write_film(
    path: Path,
    load: Callable[[int], np.ndarray],
    frames: int,
    fps: float,
    sound: Sound | None,
    faults: Sequence[FaultName],
    seed: int,
) -> Webcam:
    """Writes what a webcam makes of a recording as H.264 with sound; without faults, a clean film.

    Args:
        path: The .mp4 file.
        load: Returns the picture (H, W, 3) uint8 of a frame; H and W are even.
        frames: Number of frames.
        fps: Frames per second.
        sound: The sound.
        faults: What the webcam does wrong.
        seed: Seed of all random choices.

    Returns:
        Which pictures the film shows, and how bright.

    Raises:
        MissingExtraError: If PyAV or, for a rolling shutter, OpenCV is not installed.
    """
    webcam = webcam_of(faults, frames, fps, seed)
    pictures = pictures_of(webcam, faults, seed, load)
    hasty = "compression" in faults
    write_atomic(path, lambda part: _encode(part, webcam, pictures, fps, sound, hasty))
    return webcam


def _encode(
    path: Path,
    webcam: Webcam,
    pictures: Iterator[np.ndarray],
    fps: float,
    sound: Sound | None,
    hasty: bool,
) -> None:
    try:
        import av
    except ModuleNotFoundError:
        raise MissingExtraError("av", "train", "a webcam's film") from None

    rate = Fraction(fps).limit_denominator(1001)
    with av.open(str(path), "w", format="mp4") as container:
        first = next(pictures)
        stream = _video_stream(container, rate, first.shape, hasty)
        heard = None if sound is None else container.add_stream("aac", sound.rate, layout="mono")
        for one, picture in zip(webcam.shown, chain([first], pictures), strict=True):
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            frame.pts, frame.time_base = one.at, 1 / rate
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if heard is not None and sound is not None:
            heard.bit_rate = SOUND_BITS
            _write_sound(container, heard, sound)


def _video_stream(
    container: "OutputContainer", rate: Fraction, shape: tuple[int, ...], hasty: bool
) -> "VideoStream":
    """The stream of pictures of a shape (H, W, 3)."""
    stream = container.add_stream("libx264", rate, options=HASTY if hasty else GOOD)
    stream.height, stream.width = shape[:2]
    stream.pix_fmt = "yuv420p" if hasty else "yuv444p"
    stream.codec_context.time_base = 1 / rate
    if hasty:
        stream.bit_rate = round(BITS * float(rate) * shape[0] * shape[1])
    return stream


def _write_sound(container: "OutputContainer", heard, sound: Sound) -> None:
    import av

    frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(sound.samples[None]), "fltp", "mono")
    frame.sample_rate, frame.pts, frame.time_base = sound.rate, 0, Fraction(1, sound.rate)
    container.mux(heard.encode(frame))
    container.mux(heard.encode(None))
