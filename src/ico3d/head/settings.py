"""Settings of head training: those of the paper, and a preset for two CPU cores."""

from dataclasses import dataclass
from typing import Literal

from ico3d.common.presets import PresetName
from ico3d.training.rate import Rate


@dataclass(frozen=True)
class Network:
    """Size of the model: each Gaussian's latent basis, and the MLP that reads blended features.

    Attributes:
        features: Width f of the latent basis, numbers per Gaussian and expression value.
        hidden: Width of the MLP's hidden layers.
        frequencies: Octaves L of the position encoding, a further input of the MLP.
    """

    features: int = 32
    hidden: int = 64
    frequencies: int = 6


@dataclass(frozen=True)
class Loss:
    """Weights of the terms of the loss.

    Attributes:
        l1: Weight λ_1 of the L1 difference of rendered and recorded picture.
        ssim: Weight λ_s of 1 − SSIM.
        perceptual: Weight λ_p of the difference of VGG features; 0 where VGG's weights are not
            installed.
        perceptual_from: First step with the perceptual term.
        torso: Weight, 0 to 1, of pixels that show the person but not the head, where the capture
            tells them apart. Low values keep a torso that moves by itself from disturbing the head.
            In recordings of the whole body always 0.
        alpha: Weight of the L1 difference of rendered alpha and mask, where the capture has masks.
            Not in the paper.
        squares: Weight of the mean squared difference of rendered and recorded picture, which PSNR
            measures. Not in the paper.
    """

    l1: float = 0.8
    ssim: float = 0.2
    perceptual: float = 0.1
    perceptual_from: int = 10_000
    torso: float = 1.0
    alpha: float = 0.0
    squares: float = 0.0


@dataclass(frozen=True)
class Rates:
    """Learning rates at the first step, and the factors to which they decay until the last one.

    Attributes:
        position: Learning rate of the Gaussians' centres, relative to half the edge of the box
            around the points that training begins with.
        position_decay: Factor to which the rate of the centres has decayed at the last step.
        displacement: Learning rate of the Gaussians' displacements, relative to that of centres.
        rotation: Learning rate of the Gaussians' rotations (quaternions).
        scale: Learning rate of the logarithms of the Gaussians' sizes.
        shape_decay: Factor to which the rates of rotations and sizes have decayed at the last step.
        basis: Learning rate of the latent basis (F and f_0).
        logit: Learning rate of the basis of variants without an MLP, whose basis holds the logits
            of colours and opacity themselves; takes the place of --rates.basis.
        basis_decay: Factor to which the basis' rate has decayed at the last step.
        basis_weight_decay: Weight decay of the basis' rows except the bias: suppresses changes that
            the expression does not call for. Meant for 100 training frames and multiplied by the
            fourth power of 100 / frames, since more frames overfit less (measured:
            docs/choices.md). Not in the paper.
        mlp: Learning rate of the MLP.
        mlp_decay: Factor to which the MLP's rate has decayed at the last step.
        adaptor: Learning rate of the speech adaptor; that of its attention is five times as high,
            as in SyncTalk.
    """

    position: float = 1.6e-4
    position_decay: float = 0.01
    displacement: float = 0.01
    rotation: float = 1e-3
    scale: float = 5e-3
    shape_decay: float = 1.0
    basis: float = 2.5e-3
    logit: float = 5e-2
    basis_decay: float = 1.0
    basis_weight_decay: float = 0.0
    mlp: float = 1.6e-4
    mlp_decay: float = 0.01
    adaptor: float = 1e-3

    def by_parameter(self, has_mlp: bool) -> dict[str, Rate]:
        """The learning rates by parameter group, for a model with or without an MLP."""
        return {
            "means": Rate(self.position, self.position_decay),
            "quats": Rate(self.rotation, self.shape_decay),
            "log_scales": Rate(self.scale, self.shape_decay),
            "basis": Rate(self.basis if has_mlp else self.logit, self.basis_decay),
            "mlp": Rate(self.mlp, self.mlp_decay),
            "adaptor": Rate(self.adaptor),
        }


SGD_GAINS = {
    "means": 2.5e3,
    "quats": 2.5e6,
    "log_scales": 3.75e5,
    "basis": 1.75e6,
    "mlp": 3e3,
    "adaptor": 1e4,
}
"""Factors of the learning rates under SGD, measured (docs/choices.md).

Adam's steps are about as long as the learning rate, those of SGD are as much shorter as gradients
are. So the factors are about the reciprocals of usual gradients.
"""


@dataclass(frozen=True)
class Initial:
    """The Gaussians that training begins with.

    Attributes:
        gaussians: Number of Gaussians, on the capture's surface points and on parts of the person
            that those points miss.
    """

    gaussians: int = 2_500


@dataclass(frozen=True)
class Density:
    """Density control: when Gaussians multiply and die (3DGS, Kerbl et al. 2023, section 5).

    Attributes:
        max_gaussians: There are never more Gaussians than this.
        begin: First step at which Gaussians may multiply or die.
        until: Step from which on Gaussians neither multiply nor die.
        every: Steps between two rounds of multiplying and dying.
        gradient: Mean screen-space gradient (normalised device units) above which a Gaussian
            multiplies: a small one is cloned, a large one split.
        absgrad: Sum absolute values of screen-space gradients over a picture's pixels; usual
            together with four times the threshold.
        min_opacity: Gaussians whose predicted opacity, 0 to 1, is below this in all sampled frames
            die.
        min_contribution: Gaussians die if their contribution to every sampled picture is below
            this: the sum of their blending weights, as a factor of the median over all Gaussians.
            Not in the paper.
    """

    max_gaussians: int = 100_000
    begin: int = 500
    until: int = 15_000
    every: int = 100
    gradient: float = 2e-4
    absgrad: bool = False
    min_opacity: float = 0.005
    min_contribution: float = 0.0


@dataclass(frozen=True)
class HeadSettings:
    """How a head is trained; defaults are the paper's, but with Adam instead of SGD.

    Attributes:
        steps: Optimisation steps, one picture each.
        turns: Let the basis also follow the head's rotation, because lamps stand still while a head
            turns; bundles and avatars are shaded as at the mean rotation. Where the recording shows
            the whole body, never. Not in the paper.
        optimiser: Adam, or stochastic gradient descent as the paper says; then learning rates count
            multiples of usual gradients, because the paper's rates are Adam's (docs/choices.md).
        basis_optimiser: What the basis learns by under Adam: Adam, or RMSProp, which keeps one
            second moment for each row of a Gaussian's basis and nothing else.
        even_rows: Let the basis' rows of blendshapes that are small in most frames learn as much
            faster, at most four times, as those that are usually large learn more slowly. Not in
            the paper.
        close_ups: Further pictures per step, cropped about the mouth, from which the basis of the
            Gaussians there learns, and nothing else; none where the recording has no landmarks.
            Not in the paper.
        displacements: Most ways in which Gaussians move with the expression, as the face's
            landmarks do; 0 for Gaussians that stand still, as in the paper.
        shared_depth: Keep neighbouring Gaussians together along the line of sight, and none longer
            there than wide, where all pictures show the head from about one side. Not in the paper.
        smile: Let a head that speech drives also be told how much the person smiles, so that its
            avatar smiles when it is glad; for recordings with blendshapes. Not in the paper.
        sh_degree: Degree of the spherical harmonics, 0 to 3, by which colours depend on the
            direction of view; bundles keep degree 0.
        sh_every: Steps between two increases of the degree that is trained, which starts at 0.
        checkpoint_every: Steps from one checkpoint to the next.
        cache_gib: Memory for recorded pictures, GiB, or auto for half of what is free; what does
            not fit is read again, in the background, before each use.
        cache_dir: Folder on a disk with room where pictures that do not fit in memory are kept
            decoded while training runs, instead of being read again.
        mixed_precision: Multiply the MLP's matrices in bfloat16; on CUDA only.
        compile: Compile the MLP with torch.compile, which takes half a minute at the start.
        network: Size of the model.
        loss: Weights of the terms of the loss.
        rates: Learning rates, and the factors to which they decay.
        initial: The Gaussians that training begins with.
        density: When Gaussians multiply and die (3DGS, Kerbl et al. 2023, section 5).
    """

    steps: int = 50_000
    turns: bool = False
    optimiser: Literal["adam", "sgd"] = "adam"
    basis_optimiser: Literal["adam", "rmsprop"] = "adam"
    even_rows: bool = False
    close_ups: int = 0
    displacements: int = 0
    shared_depth: bool = False
    smile: bool = False
    sh_degree: int = 0
    sh_every: int = 1_000
    checkpoint_every: int = 1_000
    cache_gib: float | Literal["auto"] = "auto"
    cache_dir: str = ""
    mixed_precision: bool = False
    compile: bool = False
    network: Network = Network()
    loss: Loss = Loss()
    rates: Rates = Rates()
    initial: Initial = Initial()
    density: Density = Density()


PRESETS: dict[PresetName, HeadSettings] = {
    "paper": HeadSettings(),
    "cpu": HeadSettings(
        steps=2_500,
        checkpoint_every=500,
        turns=True,
        basis_optimiser="rmsprop",
        even_rows=True,
        close_ups=4,
        shared_depth=True,
        loss=Loss(perceptual=0.0, torso=0.5, alpha=0.1, squares=8.0),
        rates=Rates(
            position=2.5e-3,
            rotation=2e-2,
            scale=3e-2,
            shape_decay=0.1,
            basis=1e-2,
            basis_decay=0.3,
            basis_weight_decay=1e-5,
            mlp=2e-2,
            adaptor=1e-4,
        ),
        initial=Initial(gaussians=8_000),
        density=Density(
            max_gaussians=12_000, begin=400, until=1_800, gradient=3e-4, min_contribution=0.25
        ),
    ),
}
