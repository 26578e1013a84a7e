"""Optimising a static scene: one picture per step."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.pictures import View
from ico3d.scene.model import NAMES, StaticScene
from ico3d.scene.settings import SceneSettings, StrategyName
from ico3d.scene.surface_points import Start
from ico3d.scene.views import Example, SceneViews
from ico3d.splat.density import (
    DefaultStrategy,
    DensitySettings,
    McmcSettings,
    McmcStrategy,
    Population,
    Schedule,
    Strategy,
)
from ico3d.splat.losses import photometric, tensor_psnr
from ico3d.splat.render import render
from ico3d.splat.rendering import Rendering
from ico3d.training.epochs import Epochs
from ico3d.training.optimiser import Optimiser, check_moments

CLONE_BELOW = 0.01
PRUNE_ABOVE = 0.1
"""`CLONE_BELOW` and `PRUNE_ABOVE`: sizes relative to the scene's extent, as in 3DGS."""


class SceneTrainer:
    """The `Trainee` of a scene: Gaussians, optimiser, density control and pictures.

    All random choices of a step depend on the seed and the step's number alone.
    """

    def __init__(
        self,
        start: Start,
        views: SceneViews,
        strategy: StrategyName,
        settings: SceneSettings,
        seed: int,
    ):
        """Prepares the first step.

        Args:
            start: The initial Gaussians and the scene's extent.
            views: The pictures to learn from.
            strategy: Name of the density control.
            settings: How to train.
            seed: Seed of all random numbers.
        """
        self.scene = start.scene
        self._views, self._settings, self._seed = views, settings, seed
        self._epochs = Epochs([seed], len(views.train))
        self._extent = start.extent
        self._optimiser = Optimiser()
        self._strategy = density_control(strategy, settings, seed, start.extent)
        self._rates = settings.rates.by_parameter()
        for parameter in self.scene.parameters.values():
            parameter.requires_grad_()

    @property
    def degree(self) -> int:
        """The degree of the harmonics that the last step trains."""
        return min((self._settings.steps - 1) // self._settings.sh_every, self.scene.degree)

    @property
    def _population(self) -> Population:
        """The scene as density control sees it."""
        return Population(self.scene.parameters, self._optimiser.moments)

    def step(self, index: int) -> Mapping[str, float]:
        """Renders one picture and updates the parameters; returns the loss and other numbers."""
        self._views.expect(range(index, self._settings.steps), self._view)
        view = self._views.readable(self._views.train, self._epochs.at(index))
        example = self._example(view, index)
        degree = index // self._settings.sh_every
        rendering = render(
            self.scene.gaussians(degree),
            [view.camera],
            example.behind,
            absgrad=self._settings.density.absgrad,
        )
        loss = self._loss(rendering, example)
        (loss + self._strategy.penalty(self._population)).backward()
        self._strategy.observe(rendering.info, index)
        self._update(index)
        rate = self._rates["means"].at(index / self._settings.steps)
        self._strategy.adapt(self._population, index, rate)
        return {
            "loss": loss.item(),
            "psnr": tensor_psnr(rendering.rgb[0], example.target, example.weight),
            "gaussians": len(self.scene),
        }

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.scene)

    def grow(self, count: int) -> None:
        """Splits Gaussians at random until there are `count`."""
        self._population.grow(count, torch.Generator().manual_seed(self._seed))

    def tensors(self) -> dict[str, Tensor]:
        """Parameters, moments, and the statistics of density control."""
        named = {f"scene.{name}": value for name, value in self.scene.parameters.items()}
        named |= {f"moments.{name}": value for name, value in self._optimiser.moments.items()}
        return named | {f"density.{name}": t for name, t in self._strategy.tensors().items()}

    def place(self, name: str) -> torch.device:
        """The device of the tensor `name`: always that of the scene."""
        del name
        return self.scene.device

    def state(self) -> dict:
        """An empty dictionary: `tensors` holds everything that steps change."""
        return {}

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Restores what `tensors` returned.

        Raises:
            ValueError, KeyError: If they are of no such scene.
        """
        del state
        parts: dict[str, dict[str, Tensor]] = {"scene": {}, "moments": {}, "density": {}}
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            parts[part][rest] = tensor
        degree = self.scene.degree
        self.scene = StaticScene({n: t.requires_grad_() for n, t in parts["scene"].items()})
        if self.scene.degree != degree:
            raise ValueError(f"its harmonics are of degree {self.scene.degree}, not {degree}")
        check_moments(parts["moments"], self.scene.parameters)
        self._optimiser.moments = parts["moments"]
        self._strategy.restore(parts["density"])

    def _view(self, index: int) -> View:
        """The view of a step."""
        return self._views.train[self._epochs.at(index)]

    def _example(self, view: View, index: int) -> Example:
        """What a view asks for, on the scene's device; a person stands before a random colour."""
        color = np.random.default_rng([self._seed, index, 1]).random(3)
        return self._views.example(view, color).to(self.scene.device)

    def _loss(self, rendering: Rendering, example: Example) -> Tensor:
        """(1 − λ)·L1 + λ·(1 − SSIM) over the pixels that count."""
        image, target = rendering.rgb, example.target[None]  # (1, H, W, 3)
        if example.weight is not None:
            image = target + example.weight[..., None] * (image - target)
        weight = self._settings.loss.ssim
        return photometric(image, target, l1_weight=1 - weight, ssim_weight=weight)

    def _update(self, index: int) -> None:
        """One optimiser step on every parameter that has a gradient."""
        progress = index / self._settings.steps
        for name in NAMES:
            parameter = self.scene.parameters[name]
            if parameter.grad is None:
                continue
            rate = self._rates[name].at(progress) * (self._extent if name == "means" else 1)
            self._optimiser.update(name, parameter, parameter.grad, rate)
            parameter.grad = None


def density_control(
    name: StrategyName, settings: SceneSettings, seed: int, extent: float
) -> Strategy:
    """The named strategy, with thresholds for a scene of `extent` metres."""
    density, mcmc = settings.density, settings.mcmc
    schedule = Schedule(density.begin, density.until, density.every)
    if name == "mcmc":
        chain = McmcSettings(
            max_gaussians=density.max_gaussians,
            min_opacity=density.min_opacity,
            noise_rate=mcmc.noise,
            opacity_weight=mcmc.opacity,
            scale_weight=mcmc.scale,
        )
        return McmcStrategy(schedule, chain, seed, extent)
    thresholds = DensitySettings(
        max_gaussians=density.max_gaussians,
        gradient_threshold=density.gradient,
        clone_below=CLONE_BELOW * extent,
        prune_opacity=density.min_opacity,
        prune_scale=PRUNE_ABOVE * extent,
    )
    return DefaultStrategy(schedule, thresholds, seed, density.reset_every)
