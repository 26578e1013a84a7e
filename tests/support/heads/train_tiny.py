"""What the process does that tests kill: trains a tiny head, as `ico3d train head` does."""

from pathlib import Path

import numba
import torch

from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from support.heads.tiny_capture import TinyCapture
from support.settings import changed

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 240,
        "initial.gaussians": 200,
        "density.max_gaussians": 400,
        "density.begin": 20,
        "density.every": 20,
        "density.until": 130,
        "density.gradient": 1e-5,
        "checkpoint_every": 3,
    },
)


def train_tiny(folder: Path) -> None:
    """Trains, or goes on training, on one thread."""
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    job = HeadJob("blendshapes", "full", "builtin", 0, SETTINGS)
    train_head(TinyCapture(folder / "tiny"), folder / "model", job)
