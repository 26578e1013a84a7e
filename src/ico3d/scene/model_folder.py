"""A trained scene: what a model folder holds."""

import json
from dataclasses import dataclass
from pathlib import Path

import torch

from ico3d.common.files import write_atomic
from ico3d.errors import ModelError
from ico3d.scene.model import StaticScene
from ico3d.scene.views import Frames, Only, Space
from ico3d.training.checkpoint import load_tensors, save_tensors

ABOUT = "scene.json"
"""The file by which a folder is known to hold a scene."""


@dataclass
class TrainedScene:
    """A static scene and what it shows.

    Attributes:
        scene: The Gaussians.
        only: What of the pictures it was trained on.
        frames: The frames that it was trained on.
        space: Where it lies: the capture's world, or canonical head space.
        summary: How it was made: provenance of the capture, seconds of training, settings.
    """

    scene: StaticScene
    only: Only
    frames: Frames
    space: Space
    summary: dict

    def to(self, device: torch.device) -> "TrainedScene":
        """Moves the scene, and gives itself back."""
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
        """Reads what `save` wrote, onto the CPU.

        Raises:
            ModelError: If the folder holds no scene, or a damaged one.
        """
        folder = Path(folder)
        try:
            about = json.loads((folder / ABOUT).read_text())
            fields = {name: about[name] for name in ("only", "frames", "space", "summary")}
        except (OSError, ValueError, KeyError, TypeError) as error:
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
