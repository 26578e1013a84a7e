"""The moving capture as a folder, which other processes can open."""

import json
from pathlib import Path

import numpy as np
from PIL import Image
from safetensors.numpy import save_file

from support.bodies.moving_capture import CAMERAS, FRAMES, MovingCapture


def record(folder: Path) -> None:
    """Writes pictures, masks, points and cameras as a synthetic capture of a body."""
    capture = MovingCapture(folder)
    for number, camera in enumerate(capture.cameras):
        _write(folder / "backgrounds" / f"{camera.name}.png", capture.background(number))
        for frame in range(FRAMES):
            name = f"{camera.name}/{frame:06d}.png"
            _write(folder / "images" / name, capture.image(number, frame))
            _write(folder / "masks" / name, capture.mask(number, frame))
    frames = {
        "world_from_head": np.tile(np.eye(4), (FRAMES, 1, 1)),
        "eyes": np.zeros((FRAMES, 7)),
        "blendshapes": np.zeros((FRAMES, 1)),
        "landmarks": np.zeros((FRAMES, 68, 3)),
        "views": np.ones((FRAMES, CAMERAS), np.uint8),
        "points": np.stack([capture.world_points(frame) for frame in range(FRAMES)]),
    }
    save_file(frames, folder / "frames.safetensors")
    about = {
        "format": "ico3d-synthetic",
        "version": 2,
        "shows": "body",
        "fps": capture.fps,
        "num_frames": FRAMES,
        "blendshape_names": ["none"],
        "cameras": [_described(camera) for camera in capture.cameras],
        "sources": [],
    }
    (folder / "capture.json").write_text(json.dumps(about))


def _write(file: Path, picture: np.ndarray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((picture.clip(0, 1) * 255 + 0.5).astype(np.uint8)).save(file)


def _described(camera) -> dict:
    return {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "intrinsics": camera.intrinsics.tolist(),
        "world_to_camera": camera.world_to_camera.tolist(),
    }
