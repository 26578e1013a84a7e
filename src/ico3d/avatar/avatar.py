"""A whole person: a trained head on a trained body, as the exact models draw it."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from ico3d.avatar.head_joint import hung
from ico3d.body.model_folder import TrainedBody
from ico3d.common.files import write_atomic
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.training.checkpoint import load_tensors, save_tensors

ABOUT = "avatar.json"
"""The file by which a folder is known to hold an avatar."""
FACING = np.array([0.0, 0.0, 1.0])
"""Where the face looks in the space of the head's model."""
HEAD, BODY, PLACEMENT = "head", "body", "placement.safetensors"


@dataclass(frozen=True)
class Placement:
    """Where a head is on a body, frame by frame (docs/architecture.md, "Head poses").

    Attributes:
        canonical_from_head: (4, 4) G: a similarity from the space of the head's model to that of
            the head poses; the identity where both come from one capture.
        world_from_canonical: (F, 4, 4) rigid W_i, one per frame of the body.
    """

    canonical_from_head: np.ndarray
    world_from_canonical: np.ndarray

    @property
    def facing(self) -> np.ndarray:
        """(3,) where the face looks in the world, on average over the frames; of any length."""
        turns = self.world_from_canonical[:, :3, :3]  # (F, 3, 3)
        return turns.mean(axis=0) @ self.canonical_from_head[:3, :3] @ FACING  # (3,)

    def world_from_head(self, frame: float) -> np.ndarray:
        """(4, 4) similarity W·G at a frame, between frames as viewers interpolate it."""
        return self.pose(frame) @ self.canonical_from_head

    def pose(self, frame: float) -> np.ndarray:
        """(4, 4) rigid W at a frame, which is clamped to the clip; turns by slerp between."""
        poses = self.world_from_canonical
        place = min(max(frame, 0.0), len(poses) - 1.0)
        first = min(int(place), len(poses) - 2)
        if len(poses) == 1 or place == int(place):
            return poses[int(place)].copy()
        part, pair = place - first, poses[first : first + 2]
        pose = np.eye(4)
        pose[:3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(pair[:, :3, :3]))(part).as_matrix()
        pose[:3, 3] = (1 - part) * pair[0, :3, 3] + part * pair[1, :3, 3]
        return pose


@dataclass
class TrainedAvatar:
    """A head that was fitted to a body: Gaussians of the time and the expression.

    Attributes:
        head: Only those of its Gaussians that are drawn on the body, in the body's colours.
        body: Trained around the head.
        placement: Where the head is; on a skeleton, where its joint carries it (`joined`).
        expressions: (F, B) what drives the head through the recorded clip.
        summary: How it was made: provenance of both captures, what was measured, settings.
    """

    head: TrainedHead
    body: TrainedBody
    placement: Placement
    expressions: np.ndarray
    summary: dict

    @property
    def seconds(self) -> float:
        """How long the clip lasts."""
        return self.body.seconds

    @property
    def fps(self) -> float:
        """Frames per second of the clip."""
        return self.body.fps

    def to(self, device: torch.device) -> "TrainedAvatar":
        """Moves head and body, and gives itself back."""
        self.head.to(device)
        self.body.to(device)
        return self

    def expression(self, seconds: float) -> np.ndarray:
        """(B,) recorded expression at a time, linear between frames."""
        place = min(max(seconds * self.fps, 0.0), len(self.expressions) - 1.0)
        first = min(int(place), max(len(self.expressions) - 2, 0))
        after = min(first + 1, len(self.expressions) - 1)
        part = np.float32(place - first)
        return (1 - part) * self.expressions[first] + part * self.expressions[after]

    def head_gaussians(self, seconds: float, expression: np.ndarray | None = None) -> Gaussians:
        """The head alone, in the world.

        Args:
            seconds: When, for its place.
            expression: (B,); the recorded one by default.
        """
        values = self.expression(seconds) if expression is None else expression
        with torch.no_grad():
            drawn = self.head.model(torch.from_numpy(np.asarray(values, np.float32)))
            return drawn.transform(self.placement.world_from_head(seconds * self.fps))

    def gaussians(self, seconds: float, expression: np.ndarray | None = None) -> Gaussians:
        """The whole person in the world, the body's Gaussians first; arguments as for the head."""
        with torch.no_grad():
            body = self.body.gaussians(seconds)
        return cat([body, self.head_gaussians(seconds, expression)])

    @classmethod
    def joined(
        cls,
        head: TrainedHead,
        body: TrainedBody,
        recorded: Placement,
        expressions: np.ndarray,
        summary: dict,
    ) -> "TrainedAvatar":
        """A head on a body: where it was recorded, or on its joint, where the body has one.

        Args:
            head: The head.
            body: Trained around it.
            recorded: Where the head was in the body's recording.
            expressions: (F, B) of its frames.
            summary: As in the class.
        """
        poses = hung(recorded.world_from_canonical, body)
        placement = replace(recorded, world_from_canonical=poses)
        return cls(head, body, placement, expressions, summary)

    def save(self, folder: Path) -> None:
        """Writes head and placement beside the body, which lies in `folder/body` already."""
        (folder / HEAD).mkdir(parents=True, exist_ok=True)
        self.head.save(folder / HEAD)
        save_placement(folder / PLACEMENT, self.placement, self.expressions)
        self.save_summary(folder)

    def save_summary(self, folder: Path) -> None:
        """Writes the file by which the folder is known, where all else lies already."""
        write_atomic(folder / ABOUT, json.dumps({"summary": self.summary}, indent=1).encode())

    @classmethod
    def load(cls, folder: Path | str) -> "TrainedAvatar":
        """Reads what `save` wrote.

        Raises:
            ModelError: If the folder holds no avatar, or a damaged one.
        """
        folder = Path(folder)
        try:
            summary = json.loads((folder / ABOUT).read_text())["summary"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelError(
                f"{folder} holds no avatar ({error}): make one with ico3d assemble."
            ) from error
        head, body = TrainedHead.load(folder / HEAD), TrainedBody.load(folder / BODY)
        placement, expressions = load_placement(folder / PLACEMENT)
        frames = len(placement.world_from_canonical), body.windows[-1].last + 1
        sizes = expressions.shape[1], head.model.shape.expression_size
        if frames[0] != frames[1] or sizes[0] != sizes[1]:
            raise ModelError(
                f"{folder}: head, body and placement do not belong together: it has {frames[0]} "
                f"head poses for {frames[1]} frames, and {sizes[0]} inputs for {sizes[1]}."
            )
        return cls.joined(head, body, placement, expressions, summary)


def save_placement(file: Path, placement: Placement, expressions: np.ndarray) -> None:
    """Writes where a head is and what drives it (F, B), frame by frame."""
    tensors = {
        "canonical_from_head": torch.from_numpy(placement.canonical_from_head),
        "world_from_canonical": torch.from_numpy(placement.world_from_canonical),
        "expressions": torch.from_numpy(expressions),
    }
    save_tensors(file, tensors, {})


def load_placement(file: Path) -> tuple[Placement, np.ndarray]:
    """Reads what `save_placement` wrote.

    Raises:
        ModelError: If the file is missing or damaged.
    """
    tensors, _ = load_tensors(file)
    names = ("canonical_from_head", "world_from_canonical", "expressions")
    try:
        values = {name: tensors[name].numpy() for name in names}
    except KeyError as error:
        raise ModelError(f"{file} lacks {error}: assemble the avatar again.") from error
    count, size = [*values["expressions"].shape, 0, 0][:2]
    expected = ((4, 4), (count, 4, 4), (count, size))
    for name, shape in zip(names, expected, strict=True):
        if values[name].shape != shape or not np.isfinite(values[name]).all():
            raise ModelError(f"{file}: '{name}' must be finite and have the shape {shape}.")
    poses = Placement(values["canonical_from_head"], values["world_from_canonical"])
    return poses, values["expressions"]
