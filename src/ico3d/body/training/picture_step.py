"""What training and fine-tuning of a window share: a picture's loss, and learning from it."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ico3d.body.companion import Companion, Pruning
from ico3d.body.motion.deformation import GRID, MLP
from ico3d.body.motion.window_model import CANONICAL, WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import BodySettings
from ico3d.body.skinning.skinned import NETWORK, PER_FRAME
from ico3d.body.training.views import BodyViews, Example
from ico3d.capture.pictures import View
from ico3d.splat.density import Population
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.losses import l1, photometric
from ico3d.splat.render import render
from ico3d.splat.rendering import Rendering
from ico3d.training.optimiser import Optimiser


class Learner:
    """A window's model, its optimiser, and the pictures.

    Attributes:
        model: The Gaussians.
        optimiser: Its moments.
        views: All recorded views of the window's frames.
        affine: (C, 3, 4) corrections of colours by camera: they begin as none.
        companion: Whose Gaussians are drawn after the model's, or None.
    """

    def __init__(
        self,
        model: WindowModel,
        window: Window,
        pictures: BodyViews,
        settings: BodySettings,
        extent: float,
        seed: int,
        companion: Companion | None = None,
    ):
        """Has learnt nothing yet.

        Args:
            model: Changed in place.
            window: The window's frames.
            pictures: Pictures of the window's frames.
            settings: Rates and weights.
            extent: Size of the person in metres; the means' rate refers to it.
            seed: All randomness follows from it and from the step's number.
            companion: Who is in the pictures, too.
        """
        self.companion = companion
        self._pruning = Pruning(companion, window) if companion else None
        self.model, self.optimiser = model, Optimiser()
        self.views = pictures.views
        self._pictures, self._window, self._settings = pictures, window, settings
        self._rates, self._extent, self._seed = settings.rates.by_parameter(), extent, seed
        cameras = 1 + max(view.camera_index for view in self.views)
        self.affine = torch.eye(3, 4, device=model.device).repeat(cameras, 1, 1)  # (C, 3, 4)
        self.affine.requires_grad_(settings.color_correction)
        self._orders: dict[tuple[int, int], np.ndarray] = {}

    @property
    def population(self) -> Population:
        """The Gaussians as density control sees them."""
        return Population(self.model.gaussians, self.optimiser.moments)

    def tau(self, view: View) -> float:
        """When a view was taken, in the window."""
        return self._window.tau(view.frame)

    def view(self, views: Sequence[View], index: int) -> View:
        """Every view once per epoch, in an order of its own."""
        epoch, place = divmod(index, len(views))
        key = (len(views), epoch)
        if key not in self._orders:
            rng = np.random.default_rng([self._seed, *key])
            self._orders = {key: rng.permutation(len(views))}
        return views[self._orders[key][place]]

    def random(self, index: int, purpose: int) -> np.random.Generator:
        """Random numbers of one step."""
        return np.random.default_rng([self._seed, index, purpose])

    def example(self, view: View, index: int) -> Example:
        """What a view asks for; the person stands before a random colour."""
        return self._pictures.example(view, self.random(index, 1).random(3), self.model.device)

    def draw(self, gaussians: Gaussians, view: View, example: Example) -> Rendering:
        """The picture that a view's camera would take, with the companion in it."""
        seen = self._corrected(self.accompanied(gaussians, view.frame), view.camera_index)
        absgrad = self._settings.density.absgrad
        return render(seen, [view.camera], example.color, absgrad=absgrad)

    def accompanied(self, gaussians: Gaussians, frame: int) -> Gaussians:
        """The Gaussians, and after them the companion's of a frame."""
        if self.companion is None:
            return gaussians
        return cat([gaussians, self.companion.gaussians(frame)])

    def prune(self, index: int, steps: int) -> None:
        """Removes what stands where the companion is, if it is time for that.

        Args:
            index: Step just done.
            steps: Steps of the whole training.
        """
        if self._pruning is not None and self._pruning.due(index, steps):
            self._pruning.carry_out(self.model, self.population)

    def loss(self, rendering: Rendering, example: Example) -> Tensor:
        """λ_1·L1 + λ_s·(1 − SSIM) + λ_m·L1 of the masks (paper, loss of the body)."""
        weights = self._settings.loss
        picture = photometric(rendering.rgb, example.target[None], weights.ssim)
        return picture + weights.mask * l1(rendering.alpha[0], example.mask)

    def update(self, progress: float) -> None:
        """One optimiser step on every tensor that has a gradient.

        Args:
            progress: Part of the steps that are done, 0 to 1.
        """
        tensors = {**self.model.gaussians, **self.model.shared, "affine": self.affine}
        for name, tensor in tensors.items():
            if tensor.grad is None:
                continue
            rate = self._rates[_group(name)].at(progress)
            if name == "means":
                rate *= self._extent
            if name in PER_FRAME:
                # A row has a gradient in one of F steps; Adam divides by the root of its mean
                # square over all of them, and so makes steps that are √F times as large.
                rate /= math.sqrt(len(tensor))
            self.optimiser.update(name, tensor, tensor.grad, rate)
            tensor.grad = None

    @torch.no_grad()
    def keep_mean(self, count: int) -> None:
        """Keeps the mean of the canonical Gaussians, `count` of which are in it already."""
        moments = self.optimiser.moments
        for name in CANONICAL:
            value = self.model.gaussians[name].detach()
            mean = moments.setdefault(f"{name}.mean", value.clone())
            mean.lerp_(value, 1 / (count + 1))

    @torch.no_grad()
    def take_mean(self) -> None:
        """Puts that mean in the place of the Gaussians."""
        for name in CANONICAL:
            self.model.gaussians[name].copy_(self.optimiser.moments[f"{name}.mean"])

    def tensors(self) -> dict[str, Tensor]:
        """Parameters and moments."""
        named = {f"gaussians.{n}": value for n, value in self.model.gaussians.items()}
        named |= {f"shared.{n}": value for n, value in self.model.shared.items()}
        named |= {f"moments.{n}": value for n, value in self.optimiser.moments.items()}
        return named | {"affine": self.affine}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Takes back what `tensors` gave; what learned before learns again."""
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            if part == "moments":
                self.optimiser.moments[rest] = tensor
            elif part == "affine":
                self.affine = tensor.requires_grad_(self.affine.requires_grad)
            elif part in ("gaussians", "shared"):
                held = self.model.gaussians if part == "gaussians" else self.model.shared
                held[rest] = tensor.requires_grad_(held[rest].requires_grad)

    def _corrected(self, gaussians: Gaussians, camera: int) -> Gaussians:
        """The Gaussians in the colours of one camera."""
        if not self._settings.color_correction:
            return gaussians
        assert gaussians.colors is not None
        matrix, offset = self.affine[camera, :, :3], self.affine[camera, :, 3]  # (3, 3), (3,)
        return replace(gaussians, colors=gaussians.colors @ matrix.T + offset)


class WindowTrainee:
    """What training and fine-tuning of a window have in common as a `Trainee`."""

    def __init__(self, learner: Learner):
        """Takes over the window's model with its optimiser."""
        self._learner = learner

    @property
    def model(self) -> WindowModel:
        """The window's model, which is trained."""
        return self._learner.model

    def tensors(self) -> dict[str, Tensor]:
        """Parameters and moments."""
        return self._learner.tensors()

    def place(self, name: str) -> torch.device:
        """Every tensor of a checkpoint belongs on the model's device."""
        del name
        return self.model.device

    def state(self) -> dict:
        """Nothing beside the tensors: randomness follows from the step's number."""
        return {}

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Takes back what `tensors` gave."""
        del state
        self._learner.restore(tensors)


def _group(name: str) -> str:
    """Name of the learning rate that a tensor has."""
    if name.startswith(MLP):
        return "mlp"
    if name.startswith(GRID):
        return "grid"
    if name.startswith(NETWORK):
        return "coefficients"
    formulas = ("center", "log_duration", "path", "turn", "affine")
    return "motion" if name in formulas else name
