"""Sound inputs that the tests have no writer for."""

import json
import math
import struct
import wave
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from PIL import Image
from safetensors.numpy import save_file

from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import from_rotvec
from ico3d.rig.rig import Rig
from support.recordings import multiview_folders

FRAMES, SIZE = 3, (24, 16)


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


def write_multiview_film(folder: Path) -> None:
    """A multiview folder of two cameras with videos."""
    cameras = [multiview_folders.entry(c) for c in multiview_folders.ring(2, (64, 48))]
    multiview_folders.write_cameras(folder, cameras, 6)
    for camera in cameras:
        multiview_folders.write_video(folder / "videos" / f"{camera['name']}.mp4", 6)


def write_synthetic(folder: Path, shows: str = "head") -> None:
    """A synthetic capture of one camera."""
    picture = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)
    for kind in ("images", "masks"):
        for frame in range(FRAMES):
            file = folder / kind / "front" / f"{frame:06d}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(picture if kind == "images" else picture[..., 0]).save(file)
    (folder / "backgrounds").mkdir()
    Image.fromarray(picture).save(folder / "backgrounds" / "front.png")
    frames = {
        "world_from_head": np.tile(np.eye(4), (FRAMES, 1, 1)),
        "eyes": np.zeros((FRAMES, 7)),
        "blendshapes": np.zeros((FRAMES, 2)),
        "landmarks": np.zeros((FRAMES, 68, 3)),
        "views": np.ones((FRAMES, 1), np.uint8),
        "points": np.zeros((FRAMES, 9, 3) if shows == "body" else (9, 3)),
    }
    save_file(frames, folder / "frames.safetensors")
    camera = multiview_folders.entry(multiview_folders.ring(1, SIZE)[0]) | {"name": "front"}
    about = {"format": "ico3d-synthetic", "version": 2, "shows": shows, "fps": 25}
    about |= {"num_frames": FRAMES, "blendshape_names": ["a", "b"], "cameras": [camera]}
    about |= {"sources": ["nobody"], "phonemes": [[0.0, "a"], [0.1, ""]]}
    (folder / "capture.json").write_text(json.dumps(about))
    write_wav(folder / "audio.wav")


def small_track() -> BodyTrack:
    """A body track of two joints."""
    random = np.random.default_rng(0)
    rig = Rig(("root", "arm"), (-1, 0), np.array([[0, 1, 0], [0.2, 1, 0.0]]))
    return BodyTrack(
        rig=rig,
        fps=30.0,
        rotations=from_rotvec(random.normal(size=(FRAMES, 2, 3))).astype(np.float32),
        roots=random.normal(size=(FRAMES, 3)).astype(np.float32),
        fitted=np.ones(FRAMES, bool),
        vertices=random.normal(size=(4, 3)).astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        binding=Binding.strongest(random.random((4, 2))),
        source="nobody",
    )


def small_head_track(cameras: int) -> HeadTrack:
    """A head that stands still."""
    return HeadTrack(
        world_from_head=np.tile(np.eye(4), (FRAMES, 1, 1)),
        landmarks=np.zeros((FRAMES, 68, 3), np.float32),
        eyes=np.zeros((FRAMES, 7), np.float32),
        blendshapes=np.zeros((FRAMES, len(BLENDSHAPES)), np.float32),
        views=np.ones((FRAMES, cameras), np.uint8),
    )


def ascii_ply(data: bytes, order: str = "") -> bytes:
    """A binary PLY of floats as text, or big-endian."""
    head, body = data.split(b"end_header\n", 1)
    values = struct.unpack(f"<{len(body) // 4}f", body)
    if order:
        return (
            head.replace(b"little", b"big")
            + b"end_header\n"
            + struct.pack(f">{len(values)}f", *values)
        )
    head = head.replace(b"binary_little_endian", b"ascii")
    return head + b"end_header\n" + b"\n".join(b"%.6g" % value for value in values)
