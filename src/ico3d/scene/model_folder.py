"""A trained static scene, as a model folder stores it."""

import json
from dataclasses import dataclass
from pathlib import Path

import torch

from ico3d.common.files import json_of, write_atomic
from ico3d.errors import ModelError
from ico3d.scene.model import StaticScene
from ico3d.scene.views import Frames, Only, Space
from ico3d.training.checkpoint import DAMAGED, load_tensors, save_tensors

ABOUT = "scene.json"
"""Name of the file that marks a folder as one of a scene."""


@dataclass
class TrainedScene:
    """A static scene, and what was trained.

    Attributes:
        scene: The Gaussians.
        only: The trained part of the pictures: all, the person, or the background.
        frames: The frames of the training: all, or the number of one.
        space: The space of the Gaussians: the capture's world, or canonical head space.
        summary: How the scene was made: provenance of the capture, seconds of training, settings.
    """

    scene: StaticScene
    only: Only
    frames: Frames
    space: Space
    summary: dict

    def to(self, device: torch.device) -> "TrainedScene":
        """Moves the scene to a device and returns the same object."""
        self.scene.to(device)
        return self

    def save(self, folder: Path) -> None:
        """Writes `scene.safetensors` and `scene.json` into a folder."""
        save_tensors(folder / "scene.safetensors", self.scene.parameters, {})
        about = {
            "only": self.only,
            "frames": self.frames,
            "space": self.space,
            "summary": self.summary,
        }
        write_atomic(folder / ABOUT, json.dumps(about, indent=1).encode())

    @classmethod
    def load(cls, folder: Path | str) -> "TrainedScene":
        """Reads a folder that `save` wrote, onto the CPU.

        Raises:
            ModelError: If the folder holds no scene, or a file is damaged.
        """
        folder = Path(folder)
        try:
            about = json_of(folder / ABOUT)
            fields = {name: about[name] for name in ("only", "frames", "space", "summary")}
        except DAMAGED as error:
            raise ModelError(
                f"{folder} holds no scene ({error}): train one with ico3d train static."
            ) from error
        tensors, _ = load_tensors(folder / "scene.safetensors")
        try:
            return cls(StaticScene(tensors), **fields)
        except ValueError as error:
            raise ModelError(
                f"{folder / 'scene.safetensors'} does not hold a scene: {error}."
            ) from error
