"""Settings of static scenes: those of 3DGS, and presets for two CPU cores."""

from dataclasses import dataclass, replace
from typing import Literal

from ico3d.common.presets import PresetName
from ico3d.training.rate import REST_FACTOR, Rate

StrategyName = Literal["default", "mcmc"]
"""How Gaussians multiply: as in 3DGS, or as a Markov chain (Kheradmand et al. 2024)."""


@dataclass(frozen=True)
class Loss:
    """Weights of the terms of the loss.

    Attributes:
        ssim: Weight λ of 1 − SSIM; the L1 difference has the weight 1 − λ (3DGS).
    """

    ssim: float = 0.2


@dataclass(frozen=True)
class Rates:
    """Learning rates at the first step, and the factors to which they decay until the last one.

    Attributes:
        position: Learning rate of the Gaussians' centres, relative to the scene's extent.
        position_decay: Factor to which the rate of the centres has decayed at the last step.
        color: Learning rate of the constant spherical harmonic; that of the higher degrees is a
            twentieth of this.
        opacity: Learning rate of the opacities' logits.
        scale: Learning rate of the logarithms of the Gaussians' sizes.
        rotation: Learning rate of the Gaussians' rotations (quaternions).
        shape_decay: Factor to which the rates of colours, opacities, sizes and rotations have
            decayed at the last step; 1 in 3DGS.
    """

    position: float = 1.6e-4
    position_decay: float = 0.01
    color: float = 2.5e-3
    opacity: float = 5e-2
    scale: float = 5e-3
    rotation: float = 1e-3
    shape_decay: float = 1.0

    def by_parameter(self) -> dict[str, Rate]:
        """The learning rates by parameter; that of the means is relative to the extent."""
        return {
            "means": Rate(self.position, self.position_decay),
            "quats": Rate(self.rotation, self.shape_decay),
            "log_scales": Rate(self.scale, self.shape_decay),
            "opacity_logits": Rate(self.opacity, self.shape_decay),
            "f_dc": Rate(self.color, self.shape_decay),
            "f_rest": Rate(self.color * REST_FACTOR, self.shape_decay),
        }


@dataclass(frozen=True)
class Initial:
    """The Gaussians that training begins with.

    Attributes:
        gaussians: Number of Gaussians.
        opacity: Opacity of each, 0 to 1.
        scale: Size of each, as a factor of its distance to its neighbours.
    """

    gaussians: int = 100_000
    opacity: float = 0.1
    scale: float = 1.0


@dataclass(frozen=True)
class Density:
    """Density control: when Gaussians multiply and die (3DGS, Kerbl et al. 2023, section 5).

    Attributes:
        max_gaussians: There are never more Gaussians than this.
        begin: First step at which Gaussians may multiply or die.
        until: Step from which on Gaussians neither multiply nor die.
        every: Steps between two rounds of multiplying and dying.
        gradient: Strategy default: mean screen-space gradient (normalised device units) above which
            a Gaussian multiplies: a small one is cloned, a large one split.
        absgrad: Strategy default: sum absolute values of screen-space gradients over a picture's
            pixels; usual together with four times the threshold.
        reset_every: Strategy default: steps from one reset of all opacities to the next; 0 for no
            resets.
        min_opacity: Gaussians whose opacity, 0 to 1, is below this are removed (strategy default)
            or moved to the place of an opaque one (strategy mcmc).
    """

    max_gaussians: int = 1_000_000
    begin: int = 500
    until: int = 15_000
    every: int = 100
    gradient: float = 2e-4
    absgrad: bool = False
    reset_every: int = 3_000
    min_opacity: float = 0.005


@dataclass(frozen=True)
class Mcmc:
    """The strategy mcmc (Kheradmand et al. 2024); without effect on the strategy default.

    Attributes:
        noise: Strength λ_noise of the noise on the centres, which is also scaled by their learning
            rate and their Gaussian's covariance.
        opacity: Weight λ_o of the mean opacity in the loss, which makes superfluous Gaussians fade.
        scale: Weight λ_Σ of the mean size, relative to the scene's extent, in the loss, which makes
            superfluous Gaussians shrink.
    """

    noise: float = 5e5
    opacity: float = 0.01
    scale: float = 0.01


@dataclass(frozen=True)
class SceneSettings:
    """How a static scene is trained; defaults are those of 3DGS.

    Attributes:
        steps: Optimisation steps, one picture each.
        sh_degree: Degree of the spherical harmonics, 0 to 3, by which colours depend on the
            direction of view.
        sh_every: Steps between two increases of the degree that is trained, which starts at 0.
        checkpoint_every: Steps from one checkpoint to the next.
        cache_gib: Memory for recorded pictures, GiB, or auto for half of what is free; what does
            not fit is read again, in the background, before each use.
        cache_dir: Folder on a disk with room where pictures that do not fit in memory are kept
            decoded while training runs, instead of being read again.
        loss: Weights of the terms of the loss.
        rates: Learning rates, and the factors to which they decay.
        initial: The Gaussians that training begins with.
        density: When Gaussians multiply and die (3DGS, Kerbl et al. 2023, section 5).
        mcmc: Settings of the strategy mcmc alone (Kheradmand et al. 2024).
    """

    steps: int = 30_000
    sh_degree: int = 3
    sh_every: int = 1_000
    checkpoint_every: int = 1_000
    cache_gib: float | Literal["auto"] = "auto"
    cache_dir: str = ""
    loss: Loss = Loss()
    rates: Rates = Rates()
    initial: Initial = Initial()
    density: Density = Density()
    mcmc: Mcmc = Mcmc()


PRESETS: dict[PresetName, SceneSettings] = {
    "paper": SceneSettings(),
    "cpu": SceneSettings(
        steps=3_000,
        sh_degree=1,
        sh_every=500,
        checkpoint_every=500,
        rates=Rates(position=1.6e-3, color=1e-2, scale=1e-2, rotation=5e-3, shape_decay=0.1),
        initial=Initial(gaussians=6_000),
        density=Density(
            max_gaussians=12_000,
            begin=300,
            until=2_000,
            gradient=8e-4,
            absgrad=True,
            reset_every=0,
        ),
        mcmc=Mcmc(noise=5e3, opacity=0.002),
    ),
}

_MCMC: dict[PresetName, tuple[int, float]] = {"paper": (25_000, 0.1), "cpu": (2_500, 0.5)}
"""The last step of density control, and the initial size of Gaussians."""


def settings_for(preset: PresetName, strategy: StrategyName) -> SceneSettings:
    """The settings of a preset; mcmc changes initial opacity and scale and adapts for longer."""
    settings = PRESETS[preset]
    if strategy == "default":
        return settings
    until, scale = _MCMC[preset]
    return replace(
        settings,
        initial=replace(settings.initial, opacity=0.5, scale=scale),
        density=replace(settings.density, until=until),
    )
