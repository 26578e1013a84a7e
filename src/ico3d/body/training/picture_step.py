"""What training and fine-tuning of a window share: the loss of a picture, and learning from it."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from ico3d.body import camera_colors
from ico3d.body.checking import check_window
from ico3d.body.companion import Companion, Pruning
from ico3d.body.motion.deformation import GRID, MLP
from ico3d.body.motion.window_model import WindowModel
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
from ico3d.training.epochs import Epochs
from ico3d.training.optimiser import Optimiser, check_moments


class Learner:
    """A window's model with its optimiser and pictures.

    Attributes:
        model: The window's model.
        optimiser: The optimiser, with its moments.
        views: All recorded views of the window's frames.
        companion: Other Gaussians, which are drawn after those of the model; None for none.
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
        """Makes a learner before its first step.

        Args:
            model: The window's model, which is changed in place.
            window: Frames of the window.
            pictures: Recorded pictures of these frames.
            settings: Learning rates and weights of the loss.
            extent: Half the longest edge of the person's bounding box, metres; the learning rate of
                means is relative to it.
            seed: All randomness follows from this seed and the number of the step.
            companion: Other Gaussians that are in the pictures; None for none.
        """
        self.companion = companion
        self._pruning = Pruning(companion, window) if companion else None
        self.model, self.optimiser = model, Optimiser()
        self.views = pictures.views
        self._pictures, self._window, self._settings = pictures, window, settings
        self._rates, self._extent, self._seed = settings.rates.by_parameter(), extent, seed
        self._cameras = sorted({view.camera_index for view in self.views})
        if settings.color_correction and model.camera_colors is None:
            model.camera_colors = camera_colors.identities(1 + self._cameras[-1], model.device)
        self._epochs: dict[int, Epochs] = {}  # by the number of views

    @property
    def population(self) -> Population:
        """The Gaussians and their moments, as density control changes them."""
        return Population(self.model.gaussians, self.optimiser.moments)

    def tau(self, view: View) -> float:
        """Time τ in the window at which a view was taken."""
        return self._window.tau(view.frame)

    def expect(self, steps: range, views: Callable[[int], Sequence[View]]) -> None:
        """Begins to read the pictures of coming steps.

        Args:
            steps: The steps of the training from the next one to the last.
            views: The views among which a step chooses.
        """
        self._pictures.expect(steps, lambda step: (v := views(step))[self._epoch(len(v)).at(step)])

    def view(self, views: Sequence[View], index: int) -> View:
        """The view of step `index`: each of `views` once per epoch, in a new random order."""
        return self._pictures.readable(views, self._epoch(len(views)).at(index))

    def _epoch(self, count: int) -> Epochs:
        """The orders of `count` views."""
        if count not in self._epochs:
            self._epochs[count] = Epochs([self._seed, count], count)
        return self._epochs[count]

    def pictures_needed(self) -> tuple[int, int]:
        """Bytes of all pictures, and how many of them memory keeps; one is read to judge them."""
        self._pictures.readable(self.views, 0)
        return self._pictures.needs(len(self.views))

    def random(self, index: int, purpose: int) -> np.random.Generator:
        """A generator of random numbers for one purpose in one step."""
        return np.random.default_rng([self._seed, index, purpose])

    def example(self, view: View, index: int) -> Example:
        """The recorded picture of a view, before a random colour that step `index` decides."""
        return self._pictures.example(view, self.random(index, 1).random(3), self.model.device)

    def draw(self, gaussians: Gaussians, view: View, example: Example) -> Rendering:
        """Renders Gaussians and the companion for a view, before the example's colour."""
        absgrad, maps = self._settings.density.absgrad, self.model.camera_colors
        person = self.accompanied(gaussians, view.frame)
        rendering = render(person, [view.camera], example.color, absgrad=absgrad)
        if maps is None:
            return rendering
        return camera_colors.seen_by(rendering, maps[view.camera_index], example.color)

    def accompanied(self, gaussians: Gaussians, frame: int) -> Gaussians:
        """The Gaussians, followed by those of the companion at a frame."""
        if self.companion is None:
            return gaussians
        return cat([gaussians, self.companion.gaussians(frame)])

    def prune(self, index: int, steps: int) -> None:
        """Removes Gaussians that are where the companion is, if `Pruning.due` says so.

        Args:
            index: The step that was done.
            steps: Number of steps of the whole training.
        """
        if self._pruning is not None and self._pruning.due(index, steps):
            self._pruning.carry_out(self.model, self.population)

    def loss(self, rendering: Rendering, example: Example) -> Tensor:
        """λ_1·L1 + λ_s·(1 − SSIM) + λ_m·L1 of the masks (paper), and squared differences."""
        weights, target = self._settings.loss, example.target[None]  # (1, H, W, 3)
        loss = photometric(
            rendering.rgb,
            target,
            l1_weight=1 - weights.ssim,
            ssim_weight=weights.ssim,
            squares_weight=weights.squares,
        )
        return loss + weights.mask * l1(rendering.alpha[0], example.mask)

    def update(self, progress: float) -> None:
        """One optimiser step on every tensor that has a gradient.

        Args:
            progress: Share of the steps that are done, 0 to 1, for the decay of learning rates.
        """
        maps = self.model.camera_colors
        for name, tensor in self._trained().items():
            if tensor.grad is None:
                continue
            rate = self._rates[_group(name)].at(progress)
            if name == "means":
                rate *= self._extent
            if name in PER_FRAME:
                # Each row has a gradient in one of F steps only. Adam divides by the root mean
                # square over all steps, which makes its steps √F times as large.
                rate /= math.sqrt(len(tensor))
            self.optimiser.update(name, tensor, tensor.grad, rate)
            tensor.grad = None
        if maps is not None and maps.requires_grad:
            camera_colors.center(maps, self._cameras)

    def _trained(self) -> dict[str, Tensor]:
        """All tensors that the optimiser may know, by the names that it has for them."""
        maps = self.model.camera_colors
        named = {**self.model.gaussians, **self.model.shared}
        return named if maps is None else named | {"camera_colors": maps}

    @torch.no_grad()
    def keep_mean(self, count: int) -> None:
        """Adds the canonical Gaussians to their running mean, so far one of `count` steps."""
        moments = self.optimiser.moments
        for name in self.model.canonical_names:
            value = self.model.gaussians[name].detach()
            mean = moments.setdefault(f"{name}.mean", value.clone())
            mean.lerp_(value, 1 / (count + 1))

    @torch.no_grad()
    def take_mean(self) -> None:
        """Replaces the canonical Gaussians by their running mean (`keep_mean`)."""
        for name in self.model.canonical_names:
            self.model.gaussians[name].copy_(self.optimiser.moments[f"{name}.mean"])

    def tensors(self) -> dict[str, Tensor]:
        """Parameters, and moments of the optimiser."""
        named = {f"gaussians.{n}": value for n, value in self.model.gaussians.items()}
        named |= {f"shared.{n}": value for n, value in self.model.shared.items()}
        named |= {f"moments.{n}": value for n, value in self.optimiser.moments.items()}
        maps = self.model.camera_colors
        return named if maps is None else named | {"camera_colors": maps}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restores the state that `tensors` returned; the same tensors require gradients.

        Raises:
            ValueError, KeyError: If they are of another window.
        """
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            if part == "moments":
                self.optimiser.moments[rest] = tensor
            elif part == "camera_colors":
                if self.model.camera_colors is None or len(tensor) != len(self.model.camera_colors):
                    raise ValueError("it has colours of other cameras")
                learns = self.model.camera_colors.requires_grad
                self.model.camera_colors = tensor.requires_grad_(learns)
            elif part in ("gaussians", "shared"):
                held = self.model.gaussians if part == "gaussians" else self.model.shared
                held[rest] = tensor.requires_grad_(held[rest].requires_grad)
        check_window(self.model)
        check_moments(self.optimiser.moments, self._trained())


class WindowTrainee:
    """Base class of the `Trainee`s that train and fine-tune a window."""

    def __init__(self, learner: Learner):
        """Makes a trainee of a window's model with its optimiser."""
        self._learner = learner

    @property
    def model(self) -> WindowModel:
        """The window's model, which is trained."""
        return self._learner.model

    def tensors(self) -> dict[str, Tensor]:
        """Parameters, and moments of the optimiser."""
        return self._learner.tensors()

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.model)

    def pictures_needed(self) -> tuple[int, int]:
        """Bytes of all pictures, and how many of them memory keeps."""
        return self._learner.pictures_needed()

    def grow(self, count: int) -> None:
        """Splits Gaussians at random until there are `count`."""
        self._learner.population.grow(count, torch.Generator().manual_seed(0))

    def place(self, name: str) -> torch.device:
        """The device for a tensor of a checkpoint: always that of the model."""
        del name
        return self.model.device

    def state(self) -> dict:
        """Empty: all state is in tensors, and randomness follows from the number of the step."""
        return {}

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Restores the state that `tensors` returned; `state` is not used."""
        del state
        self._learner.restore(tensors)


def _group(name: str) -> str:
    """Key of `Rates.by_parameter` for the tensor of a name."""
    if name.startswith(MLP):
        return "mlp"
    if name.startswith(GRID):
        return "grid"
    if name.startswith(NETWORK):
        return "coefficients"
    formulas = ("center", "log_duration", "path", "turn", "camera_colors")
    return "motion" if name in formulas else name
