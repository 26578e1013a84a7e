"""Writes multiview folders, and pictures and videos to fill them with."""

import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from PIL import Image

from ico3d.common.camera import Camera, look_at

SIZE = (40, 32)
"""Width, height."""


def ring(count: int, size: tuple[int, int] = SIZE) -> list[Camera]:
    """Cameras 3 m around a person."""
    cameras = []
    for index in range(count):
        angle = 2 * np.pi * index / count + 0.2
        eye = (3 * np.sin(angle), 1.3, 3 * np.cos(angle))
        lens = np.array([[50.0, 0, size[0] / 2 + 1], [0, 52, size[1] / 2 - 1], [0, 0, 1]])
        cameras.append(Camera(*size, lens, look_at(eye, (0, 1.0, 0)), f"cam{index:02d}"))
    return cameras


def entry(camera: Camera, **more) -> dict:
    return {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "intrinsics": camera.intrinsics.tolist(),
        "world_to_camera": camera.world_to_camera.tolist(),
        **more,
    }


def write_cameras(folder: Path, cameras: list[dict], frames: int, **more) -> Path:
    """Writes cameras.json as the documentation describes it."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {"format": "ico3d-multiview", "version": 1, "fps": 30, "num_frames": frames}
    (folder / "cameras.json").write_text(json.dumps({**about, "cameras": cameras, **more}))
    return folder


def picture(camera: int, frame: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """uint8 RGB noise, the same at every call."""
    random = np.random.default_rng((camera, frame))
    return random.integers(0, 256, (size[1], size[0], 3), np.uint8)


def save(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path)


def write_folder(folder: Path, cameras: int = 5, frames: int = 3) -> Path:
    """A folder of PNG pictures."""
    rig = ring(cameras)
    for index, camera in enumerate(rig):
        for frame in range(frames):
            save(folder / "images" / camera.name / f"{frame:06d}.png", picture(index, frame))
    return write_cameras(folder, [entry(camera) for camera in rig], frames)


def numbered(number: int, size: tuple[int, int]) -> np.ndarray:
    """A picture with its number in eight stripes, black or white."""
    image = np.zeros((size[1], size[0], 3), np.uint8)
    for bit in range(8):
        image[:, bit * size[0] // 8 : (bit + 1) * size[0] // 8] = 255 * (number >> bit & 1)
    return image


def number_of(image: np.ndarray) -> int:
    """The number in a picture of `numbered`, as floats or bytes."""
    width, top = image.shape[1], 1.0 if image.dtype == np.float32 else 255
    middle = [image[8:-8, (2 * bit + 1) * width // 16].mean() / top for bit in range(8)]
    return sum(int(value > 0.5) << bit for bit, value in enumerate(middle))


def write_video(
    path: Path,
    frames: int,
    codec: str = "libx264",
    options: dict[str, str] | None = None,
    keys: int = 12,
    size: tuple[int, int] = (64, 48),
) -> Path:
    """A video whose pictures carry their numbers."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30, options=options or {})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.codec_context.gop_size = keys
        for number in range(frames):
            frame = av.VideoFrame.from_ndarray(numbered(number, size), format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path
