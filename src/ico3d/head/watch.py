"""A head in training, as `training.watch` shows it."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.expression import EYE_NAMES, SPEECH_SIZE
from ico3d.common.spread import spread
from ico3d.head.expressions import BlendshapeTrack, ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.views import Picture, head_pose, staged
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.training.watch import Slider

MOST_SLIDERS = 12
SAMPLES = 100
"""Frames that decide which inputs get a slider, and how far it goes."""
STILL = 1e-3
"""Inputs whose standard deviation is less get none."""


class WatchedHead:
    """A `Watchable`: the training frames of a capture, by the first camera that has the frame.

    Sliders are the named inputs that move most in the recording: blendshapes, or the eye values
    of a head driven by speech, whose sound features mean nothing by themselves. All other inputs
    are those of the frame.
    """

    def __init__(self, capture: Capture, model: HeadModel, track: ExpressionTrack):
        """Looks at the expressions of some frames."""
        self._capture, self._model, self._track = capture, model, track
        self._numbers = capture.split.train
        self.frames = len(self._numbers)
        self._inputs = _named_inputs(model, track)
        self.sliders: Sequence[Slider] = self._found_sliders()

    def camera(self, frame: int) -> Camera:
        """Who recorded a frame, in canonical head space."""
        return self._view(frame, self._recorded(frame)[0])

    def values(self, frame: int) -> Mapping[str, float]:
        """What the named inputs are in a frame."""
        expression = self._expression(frame)
        return {name: float(expression[index]) for name, index in self._inputs.items()}

    @torch.no_grad()
    def gaussians(self, frame: int, values: Mapping[str, float]) -> Gaussians:
        """The head in canonical space with the expression of a frame, but these inputs."""
        expression = self._expression(frame).clone()
        for name, value in values.items():
            expression[self._inputs[name]] = value
        return self._model(expression)

    @torch.no_grad()
    def pictures(self, frame: int) -> tuple[Tensor, Tensor]:
        """(H, W, 3) each, on the CPU: recorded and rendered."""
        camera, recorded = self._recorded(frame)
        plate = _tensor(self._capture.background(camera))
        mask = _tensor(self._capture.mask(camera, self._numbers[frame]))
        behind, cut = staged(Picture(recorded, mask, None), plate)
        rendered = render(self.gaussians(frame, {}), [self._view(frame, camera)], behind).rgb[0]
        return cut, rendered.cpu()

    def _recorded(self, frame: int) -> tuple[int, Tensor]:
        """The first camera that has a frame, and its picture; black where none has it."""
        for camera in range(len(self._capture.cameras)):
            image = self._capture.image(camera, self._numbers[frame])
            if image is not None:
                return camera, torch.from_numpy(image)
        first = self._capture.cameras[0]
        return 0, torch.zeros(first.height, first.width, 3)

    def _view(self, frame: int, camera: int) -> Camera:
        pose = head_pose(self._capture, self._numbers[frame])
        return self._capture.cameras[camera].moved(pose)

    @torch.no_grad()
    def _expression(self, frame: int) -> Tensor:
        """(B,)."""
        return self._track.at(self._numbers[frame])

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


def _tensor(layer: np.ndarray | None) -> Tensor | None:
    return None if layer is None else torch.from_numpy(layer)


def _named_inputs(model: HeadModel, track: ExpressionTrack) -> dict[str, int]:
    """The place in the expression of every input that has a name and does something."""
    if model.shape.variant == "static":
        return {}
    if isinstance(track, BlendshapeTrack):
        return {name: index for index, name in enumerate(track.names)}
    return {name: SPEECH_SIZE + index for index, name in enumerate(EYE_NAMES)}
