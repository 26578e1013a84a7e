"""A tiny synthetic capture that nobody has to draw."""

import json
from pathlib import Path

import numpy as np
from PIL import Image
from safetensors.numpy import save_file

from support.recordings import multiview_folders
from support.recordings.films import write_wav

FRAMES, SIZE = 3, (24, 16)


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
