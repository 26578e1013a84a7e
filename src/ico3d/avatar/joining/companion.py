"""The head as the companion of a body's training."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ico3d.avatar.avatar import HEAD, PLACEMENT, Placement, load_placement
from ico3d.avatar.joining.region import HeadRegion
from ico3d.avatar.joining.similarity import moved
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from ico3d.training.checkpoint import load_tensors

SEAM = "seam.safetensors"
"""Places about the head's border, in the space of its model."""
JITTER = 0.004
"""Metres, standard deviation about such a place."""


@dataclass(frozen=True)
class HeadSource:
    """An avatar's folder that holds its head, placement and seam already.

    Attributes:
        folder: Where they lie.
        border_points: Gaussians to begin with about the border, in each window; 0 for none.
        pruning: Whether the body keeps clear of the face.
    """

    folder: Path
    border_points: int
    pruning: bool

    def open(self, device: torch.device) -> "HeadCompanion":
        """Loads the head.

        Raises:
            ModelError: If the folder lacks a part.
        """
        head = TrainedHead.load(self.folder / HEAD)
        placement, expressions = load_placement(self.folder / PLACEMENT)
        seam = load_tensors(self.folder / SEAM)[0]["seam"].numpy()  # (P, 3)
        head.model.to(device)
        return HeadCompanion(head, placement, expressions, seam, self)

    def about(self) -> dict:
        """Settings, and a hash of the files that decide what is drawn."""
        digest = hashlib.sha256()
        head = self.folder / HEAD
        for file in (
            head / "model.safetensors",
            head / "head.json",
            self.folder / PLACEMENT,
            self.folder / SEAM,
        ):
            digest.update(file.read_bytes())
        settings = {"border_points": self.border_points, "pruning": self.pruning}
        return settings | {"head": digest.hexdigest()}


class HeadCompanion:
    """A `Companion`: the head of each frame, with the expression that was recorded there."""

    def __init__(
        self,
        head: TrainedHead,
        placement: Placement,
        expressions: np.ndarray,
        seam: np.ndarray,
        source: HeadSource,
    ):
        """Places a head.

        Args:
            head: With the Gaussians that are drawn.
            placement: Where it is in every frame.
            expressions: (F, B).
            seam: (P, 3) places about its border, in the space of its model.
            source: Where the head lies, and what the body's training does about its border.

        Raises:
            ModelError: If the head has no landmarks.
        """
        if head.landmarks is None:
            raise ModelError("this head has no landmarks: train it again.")
        self._head, self._placement, self._expressions = head, placement, expressions
        self._seam, self._source = seam, source
        self._region = HeadRegion.around(head.landmarks)
        self._drawn: dict[int, Gaussians] = {}

    def gaussians(self, frame: int) -> Gaussians:
        """The head at a frame, in the world."""
        if frame not in self._drawn:
            means = self._head.model.means
            expression = torch.from_numpy(self._expressions[frame]).to(means)  # (B,)
            with torch.no_grad():
                drawn = self._head.model(expression).detach()
                self._drawn[frame] = drawn.transform(self._placement.world_from_head(frame))
        return self._drawn[frame]

    def trespassing(self, means: Tensor, frame: float) -> Tensor:
        """(N,) bool: which places (N, 3) are inside the face or along the jaw."""
        if not self._source.pruning:
            return torch.zeros(len(means), dtype=torch.bool, device=means.device)
        head_from_world = np.linalg.inv(self._placement.world_from_head(frame))
        local = moved(head_from_world, means.detach().cpu().numpy().astype(np.float64))  # (N, 3)
        return torch.from_numpy(self._region.trespassing(local)).to(means.device)

    def border(self, frame: int, rng: np.random.Generator) -> np.ndarray:
        """(P, 3) random places about the border, in the world."""
        count = self._source.border_points if len(self._seam) else 0
        chosen = self._seam[rng.integers(max(len(self._seam), 1), size=count)]
        places = chosen + JITTER * rng.standard_normal((count, 3))
        return moved(self._placement.world_from_head(frame), places)
