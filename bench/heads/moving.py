"""What a head gains whose skin moves as the landmarks of its face do.

    python bench/heads/moving.py CAPTURE WORK [--inputs speech] [--seeds 0]

A head whose Gaussians stand still and one whose Gaussians move are trained with the same settings.
The moving one is measured twice on frames that it has not seen: with its skin where the expression
tells it to be, as an avatar has it, and where the landmarks of that frame were seen.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import tyro
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.head.expressions import ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import Inputs, TrainedHead
from ico3d.head.settings import PRESETS, HeadSettings
from ico3d.head.train_head import HeadJob, displacement_of, seen_moves, train_head
from ico3d.measure.head import evaluate_head
from ico3d.splat.gaussians import Gaussians

METRICS = ("psnr", "psnr_mask", "psnr_mouth", "lip_correlation", "lip_lag_ms")
SMALL = replace(
    PRESETS["cpu"],
    steps=1500,
    displacements=8,
    initial=replace(PRESETS["cpu"].initial, gaussians=10_000),
    density=replace(
        PRESETS["cpu"].density,
        max_gaussians=14_000,
        until=1_000,
        gradient=1.8e-4,
        min_contribution=0.15,
    ),
)


class SeenTrack:
    """A track that remembers which frame was asked for last."""

    def __init__(self, track: ExpressionTrack):
        """Begins before the first frame."""
        self.track, self.size, self.frame = track, track.size, -1

    def at(self, frame: int) -> Tensor:
        """The expression (B,) of a frame."""
        self.frame = frame
        return self.track.at(frame)


class SeenModel:
    """A head model whose skin is where landmarks were seen in the frame that was asked for last."""

    def __init__(self, model: HeadModel, moves: Mapping[int, Tensor], track: SeenTrack):
        """Takes the coefficients (M,) of the displacements by frame."""
        self._model, self._moves, self._track = model, moves, track
        self.shape, self.device = model.shape, model.device

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self._model)

    def __call__(self, expression: Tensor) -> Gaussians:
        """The Gaussians for an expression (B,)."""
        return self._model(expression, moves=self._moves[self._track.frame])


@dataclass
class SeenHead(TrainedHead):
    """A head whose skin is where landmarks were seen."""

    def track(self, capture: Capture) -> ExpressionTrack:
        """The expressions of a capture; from now on frames have the skin of that capture."""
        track = SeenTrack(super().track(capture))
        found = displacement_of(capture, self.model.shape.displacements)
        assert found is not None
        moves = seen_moves(found, capture, range(capture.num_frames))
        self.model = SeenModel(self.model, moves, track)  # type: ignore[assignment]
        return track


@dataclass(frozen=True)
class Bench:
    """What to train and measure.

    Attributes:
        capture: A recording of a head with landmarks.
        work: Folder for the heads.
        inputs: What drives the heads.
        seeds: Seeds of the trainings.
        settings: Settings of both trainings, but for the displacements of the first.
    """

    capture: tyro.conf.Positional[Path]
    work: tyro.conf.Positional[Path]
    inputs: Inputs = "speech"
    seeds: tuple[int, ...] = (0,)
    settings: HeadSettings = field(default_factory=lambda: SMALL)

    def run(self) -> None:
        """Prints a line of a table for each head."""
        capture = open_capture(self.capture)
        print("| seed | head |", " | ".join(METRICS), "|")
        for seed in self.seeds:
            for count in (0, self.settings.displacements):
                settings = replace(self.settings, displacements=count)
                job = HeadJob(self.inputs, "full", "builtin", seed, settings)
                head = train_head(capture, self.work / f"{seed}-{count}", job)
                self._print(seed, "moves, as told" if count else "stands still", head, capture)
            seen = SeenHead(**vars(head))
            self._print(seed, "moves, as seen", seen, capture)

    def _print(self, seed: int, name: str, head: TrainedHead, capture: Capture) -> None:
        frames: Sequence[int] = sorted(capture.split.test)
        values = evaluate_head(head, capture, frames, None)
        numbers = [f"{v:.2f}" if isinstance(v := values.get(key), float) else "" for key in METRICS]
        print(f"| {seed} | {name} |", " | ".join(numbers), "|", flush=True)


if __name__ == "__main__":
    sys.exit(run_script(Bench))
