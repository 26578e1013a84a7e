"""A whole person before baking: a trained head on a trained body, drawn by the trained models."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from ico3d.avatar.head_joint import hung
from ico3d.body.model_folder import TrainedBody
from ico3d.common.files import json_of, write_atomic
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.training.checkpoint import DAMAGED, FARTHEST, load_tensors, save_tensors

ABOUT = "avatar.json"
"""Name of the file that marks a folder as an avatar's."""
FACING = np.array([0.0, 0.0, 1.0])
"""(3,) direction in which the face looks, in the space of the head's model."""
HEAD, BODY, PLACEMENT = "head", "body", "placement.safetensors"


@dataclass(frozen=True)
class Placement:
    """Where a head is on a body, frame by frame (docs/architecture.md, "Head poses").

    Attributes:
        canonical_from_head: (4, 4) G, a similarity from the space of the head's model to the
            canonical head space of the body's capture; the identity where both are one capture.
        world_from_canonical: (F, 4, 4) rigid W_i, the head pose in each frame of the body.
    """

    canonical_from_head: np.ndarray
    world_from_canonical: np.ndarray

    @property
    def facing(self) -> np.ndarray:
        """(3,) mean direction in the world in which the face looks; not of length 1."""
        turns = self.world_from_canonical[:, :3, :3]  # (F, 3, 3)
        return turns.mean(axis=0) @ self.canonical_from_head[:3, :3] @ FACING  # (3,)

    def world_from_head(self, frame: float) -> np.ndarray:
        """(4, 4) similarity W·G from the head model's space to the world at a frame; see `pose`."""
        return self.pose(frame) @ self.canonical_from_head

    def pose(self, frame: float) -> np.ndarray:
        """(4, 4) rigid W at a frame, as viewers interpolate it.

        Args:
            frame: Need not be whole, and is clamped to the clip. Between two frames rotations are
                interpolated by slerp, positions linearly.
        """
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
    """A head on a body; its Gaussians depend on the time of the clip and on the expression.

    Attributes:
        head: The head, cropped to the Gaussians that are drawn on the body, its colours matched.
        body: The body, trained with the head in the picture.
        placement: Where the head is in each frame; on a skeleton, where the head's joint carries
            it (`joined`).
        expressions: (F, B) expression in each frame of the clip.
        summary: How the avatar was made: provenance of both captures, measurements, settings.
    """

    head: TrainedHead
    body: TrainedBody
    placement: Placement
    expressions: np.ndarray
    summary: dict

    @property
    def seconds(self) -> float:
        """Length of the clip in seconds."""
        return self.body.seconds

    @property
    def fps(self) -> float:
        """Frames per second of the clip."""
        return self.body.fps

    def to(self, device: torch.device) -> "TrainedAvatar":
        """Moves head and body to a device; returns this avatar."""
        self.head.to(device)
        self.body.to(device)
        return self

    @property
    def records(self) -> list[dict]:
        """What trained head, colours and body, by `capture.parts.trained_on`."""
        return [*self.head.records, *self.body.records]

    def expression(self, seconds: float) -> np.ndarray:
        """(B,) recorded expression at a time in seconds, interpolated linearly between frames."""
        place = min(max(seconds * self.fps, 0.0), len(self.expressions) - 1.0)
        first = min(int(place), max(len(self.expressions) - 2, 0))
        after = min(first + 1, len(self.expressions) - 1)
        part = np.float32(place - first)
        return (1 - part) * self.expressions[first] + part * self.expressions[after]

    def head_gaussians(self, seconds: float, expression: np.ndarray | None = None) -> Gaussians:
        """The head alone, in the world.

        Args:
            seconds: Time in the clip, which decides where the head is.
            expression: (B,); by default the recorded expression of that time.
        """
        values = self.expression(seconds) if expression is None else expression
        with torch.no_grad():
            drawn = self.head.model(torch.from_numpy(np.asarray(values, np.float32)))
            return drawn.transform(self.placement.world_from_head(seconds * self.fps))

    def gaussians(self, seconds: float, expression: np.ndarray | None = None) -> Gaussians:
        """The whole person in the world, the body's Gaussians first.

        Args:
            seconds: Time in the clip.
            expression: (B,); by default the recorded expression of that time.
        """
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
        """An avatar whose head is where it was recorded or, on a skeleton, fixed to its joint.

        Args:
            head: The head, cropped.
            body: The body, trained with this head in the picture.
            recorded: Where the head was in the body's recording.
            expressions: (F, B) expression in each of the recording's frames.
            summary: How the avatar was made.
        """
        poses = hung(recorded.world_from_canonical, body)
        placement = replace(recorded, world_from_canonical=poses)
        return cls(head, body, placement, expressions, summary)

    def save(self, folder: Path) -> None:
        """Writes head, placement and summary; the body has to lie in `folder/body` already."""
        (folder / HEAD).mkdir(parents=True, exist_ok=True)
        self.head.save(folder / HEAD)
        save_placement(folder / PLACEMENT, self.placement, self.expressions)
        self.save_summary(folder)

    def save_summary(self, folder: Path) -> None:
        """Writes `avatar.json`; head, body and placement have to lie in the folder already."""
        write_atomic(folder / ABOUT, json.dumps({"summary": self.summary}, indent=1).encode())

    @classmethod
    def load(cls, folder: Path | str) -> "TrainedAvatar":
        """Reads an avatar's folder, onto the CPU.

        Raises:
            ModelError: If the folder holds no avatar, or a damaged one.
        """
        folder = Path(folder)
        try:
            summary = json_of(folder / ABOUT)["summary"]
        except DAMAGED as error:
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
    """Writes the placement of a head and its expressions (F, B) into one file."""
    tensors = {
        "canonical_from_head": torch.from_numpy(placement.canonical_from_head),
        "world_from_canonical": torch.from_numpy(placement.world_from_canonical),
        "expressions": torch.from_numpy(expressions),
    }
    save_tensors(file, tensors, {})


def load_placement(file: Path) -> tuple[Placement, np.ndarray]:
    """Reads the file of `save_placement`: the placement and the expressions (F, B).

    Raises:
        ModelError: If the file is missing or damaged.
    """
    tensors, _ = load_tensors(file)
    names = ("canonical_from_head", "world_from_canonical", "expressions")
    try:
        values = {name: tensors[name].numpy() for name in names}
    except KeyError as error:
        raise ModelError(f"{file} lacks {error}: assemble the avatar again.") from error
    except TypeError as error:  # numbers that numpy has not
        raise ModelError(f"{file} is damaged ({error}): assemble the avatar again.") from error
    count, size = [*values["expressions"].shape, 0, 0][:2]
    expected = ((4, 4), (count, 4, 4), (count, size))
    for name, shape in zip(names, expected, strict=True):
        if values[name].shape != shape or not (np.abs(values[name]) <= FARTHEST).all():
            raise ModelError(
                f"{file}: '{name}' must be finite and have the shape {shape}; nothing in it may "
                f"be beyond {FARTHEST:,.0f}."
            )
    poses = Placement(values["canonical_from_head"], values["world_from_canonical"])
    return poses, values["expressions"]
