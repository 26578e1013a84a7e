"""What the process does that tests kill: trains a tiny head, as `ico3d train head` does."""

import os
import signal
from pathlib import Path

import numba
import torch

from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import PRESETS, HeadSettings
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

PAPER = changed(
    PRESETS["paper"],
    {
        "steps": 24,
        "optimiser": "sgd",
        "sh_degree": 3,
        "sh_every": 6,
        "loss.perceptual_from": 0,
        "initial.gaussians": 200,
        "density.max_gaussians": 400,
        "density.begin": 4,
        "density.every": 5,
        "density.until": 20,
        "density.gradient": 1e-7,
        "checkpoint_every": 8,
    },
)
"""The paper's settings with all that they switch on, in fewer steps (300: bench/paper.py)."""
SMALL = 20
"""Side of the pictures in pixels: VGG looks at each of them."""


def train_as_paper(folder: Path, dies_at: int | None = None) -> None:
    """Trains with the paper's settings; `folder/models` has VGG's weights.

    The process kills itself before step `dies_at`.
    """
    os.environ["ICO3D_MODELS"] = str(folder / "models")
    if dies_at is not None:
        step = HeadTrainer.step

        def dying_step(self, index):
            if index == dies_at:
                os.kill(os.getpid(), signal.SIGKILL)
            return step(self, index)

        HeadTrainer.step = dying_step
    _train(TinyCapture(folder / "tiny", SMALL), folder, PAPER)


def train_tiny(folder: Path) -> None:
    """Trains, or goes on training."""
    _train(TinyCapture(folder / "tiny"), folder, SETTINGS)


def _train(capture: TinyCapture, folder: Path, settings: HeadSettings) -> None:
    """Trains on one thread."""
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    job = HeadJob("blendshapes", "full", "builtin", 0, settings)
    train_head(capture, folder / "model", job)
