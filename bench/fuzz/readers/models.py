"""Readers of trained models."""

from pathlib import Path

import torch

from fuzz.reader import Reader
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.models import open_model
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.motion.formulas import Still
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.head.model_folder import TrainedHead
from ico3d.scene.model_folder import TrainedScene
from support.bodies.window_parts import ENCODED, canonical
from support.heads.offset_head import offset_head
from support.scenes.offset_scene import offset_scene


def _body(folder: Path) -> None:
    """Two windows: one that is deformed, one that is still."""
    shared = ENCODED.initial(torch.Generator().manual_seed(4))
    alpha = torch.rand(5, 2, generator=torch.Generator().manual_seed(3))
    models = [
        WindowModel(ENCODED, {**canonical(), "alpha": alpha}, shared),
        WindowModel(Still(), canonical(3), {}),
    ]
    for number, model in enumerate(models):
        save_window(folder / f"{number}.safetensors", model)
    made = TrainedBody(models, (Window(0, 4), Window(4, 6)), 15.0, "swings++", {})
    made.save(folder, ["0.safetensors", "1.safetensors"])


def _model(folder: Path) -> None:
    """Opens a model, and takes its Gaussians where it has some at a time."""
    found = open_model(folder, TrainedAvatar, TrainedBody, TrainedHead, TrainedScene)
    if isinstance(found, TrainedBody):
        found.gaussians(0.1)


MODELS = (
    Reader(
        "model folders",
        {
            "head": lambda folder: offset_head().save(folder),
            "scene": lambda folder: offset_scene("all").save(folder),
            "body": _body,
        },
        lambda: _model,
    ),
)
