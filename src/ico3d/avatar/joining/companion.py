"""The head as a companion of the body's training: it is in the picture, and stays unchanged."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ico3d.avatar.avatar import HEAD, PLACEMENT, Placement, load_placement
from ico3d.avatar.joining.similarity import moved
from ico3d.capture.face.region import HeadRegion
from ico3d.common.unpacking.memory import lacks_room
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from ico3d.training.checkpoint import load_tensors
from ico3d.training.finite import all_finite

SEAM = "seam.safetensors"
"""File with positions (P, 3) near the head's border, in the space of the head's model."""
PIECE = 1 << 20
"""Bytes of a file that are read at once while it is hashed."""
JITTER = 0.004
"""Standard deviation in metres of first points about a position near the border."""


@dataclass(frozen=True)
class HeadSource:
    """An avatar's folder from which processes that train the body load the head.

    Attributes:
        folder: The folder, with head, placement and seam.
        border_points: Number of first points near the head's border in each window; 0 for none.
        pruning: Whether Gaussians of the body are removed from the face.
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
        seam = _seam(self.folder / SEAM)
        head.model.to(device)
        return HeadCompanion(head, placement, expressions, seam, self)

    def about(self) -> dict:
        """Settings, and a hash of head, placement and seam: what the training depends on.

        Raises:
            ModelError: If a file is larger than could be loaded.
        """
        digest = hashlib.sha256()
        head = self.folder / HEAD
        for file in (
            head / "model.safetensors",
            head / "head.json",
            self.folder / PLACEMENT,
            self.folder / SEAM,
        ):
            if lacking := lacks_room(file, 1):
                raise ModelError(f"{file} {lacking}.")
            with file.open("rb") as opened:
                while piece := opened.read(PIECE):
                    digest.update(piece)
        settings = {"border_points": self.border_points, "pruning": self.pruning}
        return settings | {"head": digest.hexdigest()}


def _seam(file: Path) -> np.ndarray:
    """(P, 3) positions near the head's border.

    Raises:
        ModelError: If the file holds something else.
    """
    seam = load_tensors(file)[0].get("seam", torch.empty(0))
    if seam.dim() != 2 or seam.shape[1] != 3 or not all_finite(seam):
        raise ModelError(f"{file} holds no positions (P, 3): assemble the avatar again.")
    return seam.numpy()


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
        """Places a head in every frame of the body's recording.

        Args:
            head: The head, cropped to the Gaussians that are drawn.
            placement: Where the head is in every frame.
            expressions: (F, B) expression in every frame.
            seam: (P, 3) positions near the head's border, in the space of the head's model.
            source: Settings of what the body's training does at the border and in the face.

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
        """(N,) bool: which positions (N, 3) in the world are inside the face or along the jaw."""
        if not self._source.pruning:
            return torch.zeros(len(means), dtype=torch.bool, device=means.device)
        head_from_world = np.linalg.inv(self._placement.world_from_head(frame))
        local = moved(head_from_world, means.detach().cpu().numpy().astype(np.float64))  # (N, 3)
        return torch.from_numpy(self._region.trespassing(local)).to(means.device)

    def border(self, frame: int, rng: np.random.Generator) -> np.ndarray:
        """(P, 3) random positions near the head's border, in the world at a frame."""
        count = self._source.border_points if len(self._seam) else 0
        chosen = self._seam[rng.integers(max(len(self._seam), 1), size=count)]
        places = chosen + JITTER * rng.standard_normal((count, 3))
        return moved(self._placement.world_from_head(frame), places)
