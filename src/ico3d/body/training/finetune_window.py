"""Temporal fine-tuning: a window learns to agree with the window before it.

It is described in the paper's section on dynamic 3D body Gaussians.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from ico3d.body.companion import Companion
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import BodySettings
from ico3d.body.training.novel_views import novel_camera
from ico3d.body.training.picture_step import Learner, WindowTrainee
from ico3d.body.training.views import MARGIN, BodyViews
from ico3d.common.camera import Camera
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.losses import l1, tensor_psnr
from ico3d.splat.render import render

STILL_SEEN = 0.05
"""Opacity above which a Gaussian counts for where the person is in a picture."""


class FineTuner(WindowTrainee):
    """A `Trainee` of the canonical Gaussians of a window; motion and colour maps are frozen.

    Some steps compare the first frame of the window with the same frame of the previous window,
    rendered by novel cameras between the recording ones. The others learn from recorded pictures.
    """

    def __init__(
        self,
        model: WindowModel,
        previous: WindowModel,
        window: Window,
        pictures: BodyViews,
        cameras: Sequence[Camera],
        settings: BodySettings,
        extent: float,
        seed: int,
        companion: Companion | None = None,
    ):
        """Makes a trainee before its first step.

        Args:
            model: The window's model, which is changed in place.
            previous: The model of the window before, which is not changed.
            window: Frames of `model`.
            pictures: Recorded pictures of these frames.
            cameras: The training cameras, between which novel ones are drawn.
            settings: Learning rates and weights of the loss.
            extent: Half the longest edge of the person's bounding box, metres.
            seed: Seed of all randomness.
            companion: Other Gaussians that are in the pictures; None for none.
        """
        for name, tensor in {**model.gaussians, **model.shared}.items():
            tensor.requires_grad_(name in model.canonical_names)
        if model.camera_colors is not None:
            model.camera_colors.requires_grad_(False)  # or it would be learnt from few pictures
        super().__init__(Learner(model, window, pictures, settings, extent, seed, companion))
        self._settings, self._cameras = settings.finetune, cameras
        self._shared = window.first
        with torch.no_grad():
            self._goal = self._learner.accompanied(previous.at(1.0), self._shared)

    def step(self, index: int) -> Mapping[str, float]:
        """Learns from the window before or, by chance, from a recorded picture."""
        if self._learner.random(index, 2).random() < self._settings.consistency:
            values = self._agree(index)
        else:
            values = self._remember(index)
        start, done = self._settings.begin, index / self._settings.steps
        self._learner.update(start + (1 - start) * done)
        self._average(index)
        self._learner.prune(index, self._settings.steps)
        return values

    def _average(self, index: int) -> None:
        """Averages the Gaussians over the last steps, as each step sees only one view."""
        steps = self._settings.steps
        first = round((1 - self._settings.mean) * steps)
        if index >= first:
            self._learner.keep_mean(index - first)
            if index == steps - 1:
                self._learner.take_mean()

    def _agree(self, index: int) -> Mapping[str, float]:
        """Gradients of L_consistency: L1 between this and the previous window at their frame."""
        rng = self._learner.random(index, 3)
        camera = around(novel_camera(self._cameras, rng), self._goal)
        color = torch.from_numpy(rng.random(3)).to(self._goal.means)
        with torch.no_grad():
            goal = render(self._goal, [camera], color).rgb
        person = self._learner.accompanied(self.model.at(0.0), self._shared)
        loss = l1(render(person, [camera], color).rgb, goal)
        loss.backward()
        return {"loss": loss.item(), "difference": loss.item()}

    def _remember(self, index: int) -> Mapping[str, float]:
        """Gradients of the loss of a recorded picture, so that the window keeps its quality."""
        learner = self._learner
        learner.expect(range(index, self._settings.steps), lambda _: learner.views)
        view = learner.view(learner.views, index)
        example = learner.example(view, index)
        rendering = learner.draw(self.model.at(learner.tau(view)), view, example)
        loss = learner.loss(rendering, example)
        loss.backward()
        return {
            "loss": loss.item(),
            "psnr": tensor_psnr(rendering.rgb[0], example.target, example.mask),
        }


def around(camera: Camera, person: Gaussians) -> Camera:
    """A camera cropped to a person, with the margin of training pictures; uncropped if unseen."""
    seen = person.means[person.opacities > STILL_SEEN].detach().cpu().numpy()
    pixels, depths = camera.project(seen)  # (N, 2), (N,)
    pixels = pixels[depths > 0]
    if len(pixels) == 0:
        return camera
    size = np.array([camera.width, camera.height])
    low = np.floor(pixels.min(0) - MARGIN).clip(0, size - 1).astype(int)
    high = np.ceil(pixels.max(0) + MARGIN).clip(low + 1, size).astype(int)
    return camera.cropped(*low.tolist(), *(high - low).tolist())
