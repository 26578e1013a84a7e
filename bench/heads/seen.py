"""Heads whose skin is where landmarks were seen, instead of where an expression tells it to be.

This is what a head whose skin moves could be if sound told all of where lips are.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.errors import ModelError
from ico3d.head.expressions import ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.train_head import displacement_of, seen_moves
from ico3d.splat.gaussians import Gaussians


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
        """The expressions of a capture; from now on frames have the skin of that capture.

        Raises:
            ModelError: If the head's Gaussians stand still, or the capture tells no landmarks.
        """
        track = SeenTrack(super().track(capture))
        found = displacement_of(capture, self.model.shape.displacements)
        if found is None:
            raise ModelError("the head's Gaussians stand still, or no landmarks were recorded.")
        moves = seen_moves(found, capture, range(capture.num_frames))
        self.model = SeenModel(self.model, moves, track)  # type: ignore[assignment]
        return track
