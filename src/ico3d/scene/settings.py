"""Settings of static scenes: those of 3DGS, and those sized for two CPU cores."""

from dataclasses import dataclass, replace

from ico3d.splat.density import StrategyName
from ico3d.training.optimiser import Rate

REST_FACTOR = 1 / 20
"""Harmonics above degree 0 learn slower by this, as in 3DGS."""


@dataclass(frozen=True)
class SceneSettings:
    """How a static scene is trained; defaults are those of 3DGS.

    Attributes:
        steps: Optimisation steps, one picture each.
        ssim_weight: λ of (1 − λ)·L1 + λ·(1 − SSIM).
        sh_degree: Degree of the spherical harmonics, 0 to 3.
        sh_every: Steps after which the next degree begins to learn.
        position_rate: Learning rate of the means, times the scene's extent.
        position_decay: What it decays to, as a factor.
        color_rate: Learning rate of the constant harmonic; the others learn at a twentieth.
        opacity_rate: Learning rate of the opacity logits.
        scale_rate: Learning rate of the log scales.
        rotation_rate: Learning rate of the quaternions.
        late_decay: What colour, opacity, scale and rotation rates decay to, as a factor.
        initial_gaussians: Gaussians to start with.
        initial_opacity: Their opacity.
        initial_scale: Their size, as a factor of their distance to one another.
        max_gaussians: Never more than this many.
        densify_from: First step at which their number may change.
        densify_until: It does not from this step on.
        densify_every: Steps between two changes.
        densify_gradient: Strategy default: screen gradient above which a Gaussian clones or splits.
        absgrad: Strategy default: whether those gradients are summed over pixels without signs.
        reset_every: Strategy default: steps between two opacity resets; 0 for none.
        min_opacity: Below this a Gaussian dies (default) or moves to a living one (mcmc).
        noise_rate: Strategy mcmc: noise on the means, times their learning rate and covariance.
        opacity_weight: Strategy mcmc: weight of the mean opacity in the loss.
        scale_weight: Strategy mcmc: weight of the mean scale, relative to the scene's extent.
        checkpoint_every: Steps between checkpoints.
        cache_gib: Pictures kept in memory, in GiB; further ones are read again at each use.
    """

    steps: int = 30_000
    ssim_weight: float = 0.2
    sh_degree: int = 3
    sh_every: int = 1_000
    position_rate: float = 1.6e-4
    position_decay: float = 0.01
    color_rate: float = 2.5e-3
    opacity_rate: float = 5e-2
    scale_rate: float = 5e-3
    rotation_rate: float = 1e-3
    late_decay: float = 1.0
    initial_gaussians: int = 100_000
    initial_opacity: float = 0.1
    initial_scale: float = 1.0
    max_gaussians: int = 1_000_000
    densify_from: int = 500
    densify_until: int = 15_000
    densify_every: int = 100
    densify_gradient: float = 2e-4
    absgrad: bool = False
    reset_every: int = 3_000
    min_opacity: float = 0.005
    noise_rate: float = 5e5
    opacity_weight: float = 0.01
    scale_weight: float = 0.01
    checkpoint_every: int = 1_000
    cache_gib: float = 2.0

    def rates(self) -> dict[str, Rate]:
        """The learning rates by parameter; that of the means is relative to the extent."""
        return {
            "means": Rate(self.position_rate, self.position_decay),
            "quats": Rate(self.rotation_rate, self.late_decay),
            "log_scales": Rate(self.scale_rate, self.late_decay),
            "opacity_logits": Rate(self.opacity_rate, self.late_decay),
            "f_dc": Rate(self.color_rate, self.late_decay),
            "f_rest": Rate(self.color_rate * REST_FACTOR, self.late_decay),
        }


_PAPER = SceneSettings()
_CPU = SceneSettings(
    steps=3_000,
    sh_degree=1,
    sh_every=500,
    position_rate=1.6e-3,
    color_rate=1e-2,
    scale_rate=1e-2,
    rotation_rate=5e-3,
    late_decay=0.1,
    initial_gaussians=6_000,
    max_gaussians=12_000,
    densify_from=300,
    densify_until=2_000,
    densify_gradient=8e-4,
    absgrad=True,
    reset_every=0,
    checkpoint_every=500,
)

PRESETS: dict[tuple[str, StrategyName], SceneSettings] = {
    ("paper", "default"): _PAPER,
    ("paper", "mcmc"): replace(
        _PAPER, densify_until=25_000, initial_opacity=0.5, initial_scale=0.1
    ),
    ("cpu", "default"): _CPU,
    ("cpu", "mcmc"): replace(
        _CPU,
        densify_until=2_500,
        initial_opacity=0.5,
        initial_scale=0.5,
        noise_rate=5e3,
        opacity_weight=0.002,
    ),
}
"""By name of the preset and of the strategy."""
