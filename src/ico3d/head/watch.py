"""A head in training as the live page of `training.watch` shows it."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.common.expression import FACE_NAMES, SPEECH_SIZE
from ico3d.common.spread import spread
from ico3d.head.expressions import BlendshapeTrack, ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.optimise import HeadTrainer
from ico3d.head.views import View, staged
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.training.watch import LivePage, Slider

MOST_SLIDERS = 12
SAMPLES = 100
"""Number of frames that decide which inputs get a slider, and the slider's range."""
STILL = 1e-3
"""Inputs with a smaller standard deviation over those frames get no slider."""


class WatchedHead:
    """The `Watchable` of a head; a frame is shown as its first recorded picture shows it.

    Sliders are the named inputs that vary most in the recording: blendshapes, or, for a head driven
    by speech, the eye values, since sound features have no meaning for people. All other inputs
    keep the frame's values.
    """

    def __init__(self, trainer: HeadTrainer):
        """Chooses the sliders from the expressions of some frames."""
        self._trainer = trainer
        first: dict[int, View] = {}
        for view in trainer.views:
            first.setdefault(view.frame, view)
        self._views = list(first.values())
        self.frames = len(self._views)
        self._inputs = _named_inputs(trainer.model, trainer.track)
        self.sliders: Sequence[Slider] = self._found_sliders()

    def camera(self, frame: int) -> Camera:
        """The camera that recorded a frame, in canonical head space."""
        return self._views[frame].camera

    def values(self, frame: int) -> Mapping[str, float]:
        """The values of the sliders' inputs in a frame."""
        expression = self._expression(frame)
        return {name: float(expression[index]) for name, index in self._inputs.items()}

    @torch.no_grad()
    def gaussians(self, frame: int, values: Mapping[str, float]) -> Gaussians:
        """The head in canonical space with a frame's expression, but with these `values`."""
        expression = self._expression(frame).clone()
        for name, value in values.items():
            expression[self._inputs[name]] = value
        return self._trainer.posed(self._trainer.model(expression), self._views[frame])

    @torch.no_grad()
    def pictures(self, frame: int) -> tuple[Tensor, Tensor]:
        """The recorded picture of a frame and its rendering, (H, W, 3) each, on the CPU."""
        view, device = self._views[frame], self._trainer.model.device
        plate = self._trainer.pictures.background(view, device)
        behind, recorded = staged(self._trainer.pictures.picture(view, device), plate)
        rendered = render(self.gaussians(frame, {}), [view.camera], behind).rgb[0]
        return recorded.cpu(), rendered.cpu()

    @torch.no_grad()
    def _expression(self, frame: int) -> Tensor:
        """(B,), or (B + 3,) where the model follows the head's rotation."""
        return self._trainer.expression(self._views[frame]).cpu()

    def _found_sliders(self) -> list[Slider]:
        """Sliders for the inputs that move in the recording, those that move most first."""
        frames = spread(self.frames, SAMPLES)
        expressions = torch.stack([self._expression(frame) for frame in frames])  # (S, B)
        motion = expressions.std(0, correction=0)  # (B,)
        moving = [name for name, index in self._inputs.items() if motion[index] > STILL]
        moving.sort(key=lambda name: -float(motion[self._inputs[name]]))
        columns = {name: expressions[:, self._inputs[name]] for name in moving[:MOST_SLIDERS]}
        return [
            Slider(name, round(float(values.min()), 3), round(float(values.max()), 3))
            for name, values in columns.items()
        ]


def live_page(trainer: HeadTrainer, port: int) -> LivePage:
    """A page in the browser that shows a training, on this port or the next free one.

    Raises:
        MissingExtraError: If viser is not installed.
    """
    return LivePage(WatchedHead(trainer), port)


def _named_inputs(model: HeadModel, track: ExpressionTrack) -> dict[str, int]:
    """The place in the expression of every input that has a name and does something."""
    if model.shape.variant == "static":
        return {}
    if isinstance(track, BlendshapeTrack):
        return {name: index for index, name in enumerate(track.names)}
    names = FACE_NAMES[: track.size - SPEECH_SIZE]
    return {name: SPEECH_SIZE + index for index, name in enumerate(names)}
