"""Joins the parts of a recording to one video."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ico3d.avatar.film.video import write_video
from ico3d.capture.capture import Sound
from ico3d.capture.video import SOUND_RATE, Video, open_video, read_sound
from ico3d.common.sound import RECORDING
from ico3d.errors import CaptureError

FPS = 25
"""Pictures per second, as heads are trained with."""
LARGEST = 720
"""Upper limit of the pictures' short side in pixels."""
SAME = 0.02
"""By how much the shape of parts may differ, as a share."""


def join(files: Sequence[Path], out: Path) -> None:
    """Writes one video of several, one behind the other, all in the size of the first.

    Browsers record with a changing rate, and parts of their files cannot be put together as they
    are: pictures are taken evenly by time, and each part's sound is made as long as its pictures.

    Args:
        files: The parts, with sound or without.
        out: The .mp4 file.

    Raises:
        CaptureError: If a part is no video, or has another shape than the first, or all together
            are longer than one recording may be.
        StorageError: If the disk is full.
    """
    videos = [open_video(file, LARGEST) for file in files]
    size = _even(videos[0])
    for video in videos[1:]:
        if abs(video.width * size[1] / (video.height * size[0]) - 1) > SAME:
            names = {"part": video.path.name, "first": videos[0].path.name}
            raise CaptureError.of("shape", values=names)
    sound = _sound(videos)
    pictures = (picture for video in videos for picture in _scaled(video, size))
    write_video(out, pictures, size, FPS, Sound(sound, SOUND_RATE))


def _even(video: Video) -> tuple[int, int]:
    """Width and height of a video as H.264 takes them."""
    return video.width // 2 * 2, video.height // 2 * 2


def _scaled(video: Video, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """A video's pictures in a size, width and height."""
    import av

    for picture in video.frames(FPS):
        if picture.shape[1::-1] != size:
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            picture = frame.reformat(*size, interpolation="AREA").to_ndarray()
        yield picture


def _sound(videos: Sequence[Video]) -> np.ndarray:
    """(pictures · 640,) the sound of all, each cut off or filled up with silence.

    Raises:
        CaptureError: If all together are longer than one recording may be.
    """
    ends = [0]
    for video in videos:
        ends.append(ends[-1] + sum(1 for _ in video.frames(FPS)) * SOUND_RATE // FPS)
        if ends[-1] > RECORDING * SOUND_RATE:
            raise CaptureError.of("long", values={"n": round(RECORDING)})
    whole = np.zeros(ends[-1], np.float32)
    for video, begin, end in zip(videos, ends, ends[1:], strict=False):
        sound = read_sound(video.path)
        if sound is not None:
            heard = sound.samples[: end - begin]
            whole[begin : begin + len(heard)] = heard
    return whole
