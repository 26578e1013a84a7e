"""Small sound files and films."""

import math
import wave
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from support.recordings import multiview_folders


def write_wav(path: Path, rate: int = 16_000, channels: int = 1, width: int = 2) -> None:
    """A twentieth of a second of a tone."""
    count = rate // 20
    tone = [int(math.sin(i / 5) * 100) for i in range(count) for _ in range(channels)]
    with wave.open(str(path), "wb") as sound:
        sound.setnchannels(channels)
        sound.setsampwidth(width)
        sound.setframerate(rate)
        whole = b"".join(value.to_bytes(4, "little", signed=True)[:width] for value in tone)
        sound.writeframes(whole)


def write_film(path: Path) -> None:
    """A film of ten pictures, with sound where the suffix is .mp4 or .mov."""
    with av.open(str(path), "w") as container:
        pictures = container.add_stream("mpeg4" if path.suffix == ".avi" else "libx264", rate=25)
        pictures.width, pictures.height, pictures.pix_fmt = 64, 48, "yuv420p"
        heard = container.add_stream("aac", rate=16_000) if path.suffix == ".mp4" else None
        for number in range(10):
            made = multiview_folders.numbered(number, (64, 48))
            frame = av.VideoFrame.from_ndarray(made, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 25)
            container.mux(pictures.encode(frame))
        container.mux(pictures.encode())
        if heard is not None:
            tone = np.sin(np.arange(6400) / 9).astype(np.float32)[None]
            frame = av.AudioFrame.from_ndarray(tone, format="fltp", layout="mono")
            frame.rate, frame.pts = 16_000, 0
            container.mux(heard.encode(frame))
            container.mux(heard.encode())


def write_heard(path: Path, samples: np.ndarray, rate: int, pictures: bool = True) -> Path:
    """A film with a sound (S,) of 16 bits, without loss."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream("flac", rate=rate, layout="mono")
        if pictures:
            picture = out.add_stream("mpeg4", rate=25)
            picture.width = picture.height = 16
            out.mux([*picture.encode(av.VideoFrame(16, 16, "yuv420p")), *picture.encode()])
        for start in range(0, len(samples), 4608):
            piece = np.ascontiguousarray(samples[None, start : start + 4608])
            frame = av.AudioFrame.from_ndarray(piece, "s16", "mono")
            frame.sample_rate, frame.pts = rate, start
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
    return path
