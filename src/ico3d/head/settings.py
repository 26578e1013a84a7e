"""Settings of head training: the paper's, and those sized for two CPU cores."""

from dataclasses import dataclass
from typing import Literal

from ico3d.training.changes import with_changes
from ico3d.training.optimiser import Rate


@dataclass(frozen=True)
class HeadSettings:
    """How a head is trained; defaults are the paper's, with Adam instead of SGD.

    Attributes:
        steps: Optimisation steps, one image each.
        optimiser: `adam`, or `sgd` as the paper says.
        features: f, width of the latent basis.
        hidden: Width of the MLP.
        frequencies: L, octaves of the position encoding.
        l1_weight: λ_1 of the loss.
        ssim_weight: λ_s, of 1 − SSIM.
        perceptual_weight: λ_p, of the VGG term.
        perceptual_from: First step with the VGG term.
        torso_weight: Weight of pixels that show the person but not the head, where the capture
            tells them apart: a torso that moves by itself shall not teach the head.
        alpha_weight: Weight of the difference between rendered alpha and mask, where masks exist.
        position_rate: Learning rate of the means, times the size of the head box.
        position_decay: What it decays to, as a factor.
        rotation_rate: Learning rate of the quaternions.
        scale_rate: Learning rate of the log scales.
        shape_decay: What these two decay to, as a factor.
        basis_rate: Learning rate of the latent basis F and f_0.
        logit_rate: The same for variants without an MLP, whose basis holds the logits themselves.
        basis_decay: What it decays to, as a factor.
        basis_weight_decay: Factor of the basis' rows, the bias excepted, added to their gradient:
            what the expression need not change, it shall not. For 100 training frames; it falls
            with the fourth power of their number: many frames are not learned by heart (measured:
            docs/choices.md).
        mlp_rate: Learning rate of the MLP.
        mlp_decay: What it decays to, as a factor.
        adaptor_rate: Learning rate of the speech adaptor.
        initial_gaussians: Gaussians to start with, sampled from the capture's surface points.
        max_gaussians: Densification stops at this number.
        densify_from: First step of densification and pruning.
        densify_until: Last step of densification and pruning.
        densify_every: Steps between two densifications.
        densify_gradient: Screen-space gradient above which a Gaussian is cloned or split.
        absgrad: Whether that gradient is summed over pixels without signs; four times the
            threshold is usual then.
        prune_opacity: Gaussians whose predicted opacity stays below this are removed.
        prune_contribution: Gaussians whose blending weights sum up to less than this in every
            sampled picture, as a factor of the median over all Gaussians, are removed.
        checkpoint_every: Steps between checkpoints.
        cache_gib: Images kept in memory, in GiB; further ones are read again at each use.
        mixed_precision: Whether the MLP computes in bfloat16; on CUDA only.
        compile: Whether torch.compile makes the MLP's code, which takes half a minute first.
    """

    steps: int = 50_000
    optimiser: Literal["adam", "sgd"] = "adam"
    features: int = 32
    hidden: int = 64
    frequencies: int = 6
    l1_weight: float = 0.8
    ssim_weight: float = 0.2
    perceptual_weight: float = 0.1
    perceptual_from: int = 10_000
    torso_weight: float = 1.0
    alpha_weight: float = 0.0
    position_rate: float = 1.6e-4
    position_decay: float = 0.01
    rotation_rate: float = 1e-3
    scale_rate: float = 5e-3
    shape_decay: float = 1.0
    basis_rate: float = 2.5e-3
    logit_rate: float = 5e-2
    basis_decay: float = 1.0
    basis_weight_decay: float = 0.0
    mlp_rate: float = 1.6e-4
    mlp_decay: float = 0.01
    adaptor_rate: float = 1e-3
    initial_gaussians: int = 2_500
    max_gaussians: int = 100_000
    densify_from: int = 500
    densify_until: int = 15_000
    densify_every: int = 100
    densify_gradient: float = 2e-4
    absgrad: bool = False
    prune_opacity: float = 0.005
    prune_contribution: float = 0.0
    checkpoint_every: int = 1_000
    cache_gib: float = 2.0
    mixed_precision: bool = False
    compile: bool = False

    def rates(self, has_mlp: bool) -> dict[str, Rate]:
        """The learning rates by parameter group, for a model with or without an MLP."""
        basis_rate = self.basis_rate if has_mlp else self.logit_rate
        return {
            "means": Rate(self.position_rate, self.position_decay),
            "quats": Rate(self.rotation_rate, self.shape_decay),
            "log_scales": Rate(self.scale_rate, self.shape_decay),
            "basis": Rate(basis_rate, self.basis_decay),
            "mlp": Rate(self.mlp_rate, self.mlp_decay),
            "adaptor": Rate(self.adaptor_rate),
        }

    def with_changes(self, changes: tuple[str, ...]) -> "HeadSettings":
        """These settings with some values replaced.

        Args:
            changes: Words `name=value`.

        Raises:
            SettingsError: If a name is unknown or a value has the wrong type.
        """
        return with_changes(self, changes)


PRESETS: dict[str, HeadSettings] = {
    "paper": HeadSettings(),
    "cpu": HeadSettings(
        steps=2_500,
        perceptual_weight=0.0,
        torso_weight=0.5,
        alpha_weight=0.1,
        position_rate=2.5e-3,
        rotation_rate=2e-2,
        scale_rate=3e-2,
        shape_decay=0.1,
        basis_rate=1e-2,
        logit_rate=5e-2,
        basis_decay=0.3,
        basis_weight_decay=1e-5,
        mlp_rate=2e-2,
        adaptor_rate=1e-4,
        initial_gaussians=8_000,
        max_gaussians=12_000,
        densify_from=400,
        densify_until=1_800,
        densify_gradient=3e-4,
        prune_contribution=0.25,
        checkpoint_every=500,
    ),
}
