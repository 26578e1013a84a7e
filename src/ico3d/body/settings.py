"""Settings of body training: the paper's, and those sized for two CPU cores."""

from dataclasses import dataclass, replace
from typing import Literal

from ico3d.training.optimiser import Rate

Method = Literal["swings++", "swings", "4dgs", "spacetime", "freetime", "static"]
"""SWinGS++; SWinGS: a positional encoding in the place of the encoder; 4DGS: one window for the
whole clip, the encoder, no tuning; Spacetime Gaussians and FreeTime: one window whose Gaussians
come, move and go by formulas; static: Gaussians that do not move within a window."""

Source = Literal["best", "hull"]
"""Where the Gaussians of a window begin: on the best surface that the capture can give (its own
points, else the visual hull), or on the visual hull in any case."""

ONE_WINDOW: tuple[Method, ...] = ("4dgs", "spacetime", "freetime")
"""Methods that take the whole clip as one window."""


@dataclass(frozen=True)
class BodySettings:
    """How a body is trained; defaults are the paper's and, where it is silent, 3DGS's.

    Attributes:
        motion_threshold: Motion that a window may add up to, cm²
            (`ico3d.body.planning.flow.ClipFlow`).
        shortest_window: Frames that a window has at least.
        longest_window: Frames that it has at most.
        initial: Where Gaussians begin: the best that the capture allows, or the visual hull.
        initial_gaussians: Gaussians to start with, per window.
        initial_opacity: Their opacity.
        initial_scale: Their size, as a factor of their distance to one another.
        max_gaussians: Never more than this many in a window.
        steps: Optimisation steps of a window, one picture each.
        steps_per_frame: Where above 0: steps per frame of the window, in the place of `steps`.
        warmup_steps: Steps on the window's centre frame alone, before anything moves.
        ssim_weight: λ_s; λ_1 is 1 − λ_s.
        mask_weight: λ_m, of the L1 difference of alpha and mask.
        color_correction: Whether every camera learns an affine correction of colours, so that
            cameras need not agree about them.
        sets: M, sets of weights of the tunable MLP.
        width: Width of the MLP.
        depth: Its hidden layers.
        bands: Octaves of the positional encoding (SWinGS).
        grid_space: Resolution of the encoder's planes along space.
        grid_scales: Scales of the encoder, each of twice the resolution of the one before.
        grid_channels: Features per plane and scale.
        smoothness_weight: Of the planes' second differences.
        stillness_weight: Of the distance of time planes from 1.
        position_rate: Learning rate of the means, times the scene's extent.
        position_decay: What it decays to, as a factor.
        rotation_rate: Learning rate of the quaternions.
        scale_rate: Learning rate of the log scales.
        opacity_rate: Learning rate of the opacity logits.
        color_rate: Learning rate of the colour logits.
        shape_decay: What these four decay to, as a factor.
        mlp_rate: Learning rate of the MLP.
        grid_rate: Learning rate of the planes.
        blend_rate: Learning rate of α.
        motion_rate: Learning rate of the formulas of Spacetime and FreeTime Gaussians.
        duration: How long those last at the beginning, as a part of the window.
        motion_decay: What these four decay to, as a factor.
        densify_from: First step at which the number of Gaussians may change.
        densify_until: Part of the steps after which it does not.
        densify_every: Steps between two changes.
        densify_gradient: Screen gradient above which a Gaussian clones or splits.
        densify_growth: Part of the Gaussians that may do so at once, those of strongest gradient.
        absgrad: Whether those gradients are summed over pixels without signs.
        min_opacity: Below this a Gaussian dies.
        finetune_steps: Steps of temporal fine-tuning per window; 0 for none.
        consistency: Part of those steps that compare with the window before.
        finetune_from: Where on the decay of the learning rates fine-tuning begins: 0 where training
            did, 1 where that ended.
        finetune_mean: Part of those steps, the last ones, with whose mean Gaussians they end; 0
            for the last step's Gaussians as they are.
        checkpoint_every: Steps between checkpoints.
        cache_gib: Pictures kept in memory, in GiB; further ones are read again at each use.
    """

    motion_threshold: float = 100.0
    shortest_window: int = 6
    longest_window: int = 16
    initial: Source = "best"
    initial_gaussians: int = 50_000
    initial_opacity: float = 0.1
    initial_scale: float = 1.0
    max_gaussians: int = 200_000
    steps: int = 30_000
    steps_per_frame: int = 0
    warmup_steps: int = 1_000
    ssim_weight: float = 0.2
    mask_weight: float = 0.1
    color_correction: bool = False
    sets: int = 2
    width: int = 64
    depth: int = 2
    bands: int = 6
    grid_space: int = 64
    grid_scales: int = 2
    grid_channels: int = 16
    smoothness_weight: float = 0.0
    stillness_weight: float = 0.0
    position_rate: float = 1.6e-4
    position_decay: float = 0.01
    rotation_rate: float = 1e-3
    scale_rate: float = 5e-3
    opacity_rate: float = 5e-2
    color_rate: float = 1e-2
    shape_decay: float = 1.0
    mlp_rate: float = 1e-4
    grid_rate: float = 1.6e-3
    blend_rate: float = 1e-4
    motion_rate: float = 1e-3
    duration: float = 0.15
    motion_decay: float = 0.1
    densify_from: int = 500
    densify_until: float = 0.5
    densify_every: int = 100
    densify_gradient: float = 2e-4
    densify_growth: float = 1.0
    absgrad: bool = False
    min_opacity: float = 0.005
    finetune_steps: int = 20_000
    consistency: float = 0.75
    finetune_from: float = 0.0
    finetune_mean: float = 0.0
    checkpoint_every: int = 1_000
    cache_gib: float = 2.0

    def steps_of(self, frames: int) -> int:
        """Optimisation steps of a window of this many frames."""
        return self.steps_per_frame * frames if self.steps_per_frame else self.steps

    def rates(self) -> dict[str, Rate]:
        """Learning rates by the name of the parameter; that of the means is per metre of extent."""
        shape, motion = self.shape_decay, self.motion_decay
        return {
            "means": Rate(self.position_rate, self.position_decay),
            "quats": Rate(self.rotation_rate, shape),
            "log_scales": Rate(self.scale_rate, shape),
            "opacity_logits": Rate(self.opacity_rate, shape),
            "color_logits": Rate(self.color_rate, shape),
            "alpha": Rate(self.blend_rate, motion),
            "mlp": Rate(self.mlp_rate, motion),
            "grid": Rate(self.grid_rate, motion),
            "motion": Rate(self.motion_rate, motion),
        }


PAPER = BodySettings()
CPU = BodySettings(
    initial_gaussians=4_000,
    max_gaussians=7_000,
    initial_opacity=0.3,
    steps=2_150,
    warmup_steps=200,
    grid_space=32,
    grid_scales=2,
    position_rate=1e-3,
    position_decay=0.03,
    rotation_rate=1e-3,
    scale_rate=1e-2,
    opacity_rate=3e-2,
    color_rate=1e-2,
    mlp_rate=2e-3,
    grid_rate=2e-2,
    blend_rate=1e-3,
    motion_rate=5e-3,
    densify_from=200,
    densify_gradient=0.0,
    densify_growth=0.12,
    absgrad=True,
    finetune_steps=3_500,
    finetune_from=0.5,
    finetune_mean=0.5,
    checkpoint_every=500,
)


def settings_for(preset: Literal["paper", "cpu"], method: Method) -> BodySettings:
    """The settings of a method; a baseline differs where its own paper does."""
    settings = PAPER if preset == "paper" else CPU
    if method == "swings":
        return replace(settings, depth=4)
    if method == "4dgs":
        return replace(settings, sets=1)
    return settings
