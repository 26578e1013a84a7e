"""Settings of body training: the paper's, and settings sized for two CPU cores."""

from dataclasses import dataclass, replace
from typing import Literal

from ico3d.common.presets import PresetName
from ico3d.training.rate import REST_FACTOR, Rate

Method = Literal["swings++", "swings", "4dgs", "spacetime", "freetime", "static", "skinned", "hugs"]
"""How a body's Gaussians are moved.

- swings++: SWinGS++;
- swings: with a positional encoding instead of the encoder;
- 4dgs: one window for the whole clip, with the encoder, without tuning;
- spacetime, freetime (Spacetime Gaussians, FreeTime): one window whose Gaussians appear, move and
  vanish by formulas;
- static: Gaussians do not move within a window;
- skinned: one window whose Gaussians are bound to a skeleton, with residual shapes and light;
- hugs: as skinned, without residual shapes and light.
"""

Source = Literal["best", "hull"]
"""Surface on which the Gaussians of a window begin.

best: the capture's own points, where it has some, else the visual hull; hull: always the visual
hull.
"""

SKINNED: tuple[Method, ...] = ("skinned", "hugs")
"""Methods whose Gaussians are bound to a skeleton; they need a body track."""

ONE_WINDOW: tuple[Method, ...] = ("4dgs", "spacetime", "freetime", *SKINNED)
"""Methods that take the whole clip as one window."""


@dataclass(frozen=True)
class Windows:
    """Where the clip is cut into windows.

    Attributes:
        threshold: Largest sum of the motion of a window's frames, cm² (how it is measured:
            docs/bodies.md).
        shortest: Least number of frames of a window.
        longest: Largest number of frames of a window.
        segment: Number of frames of each window of methods that do not follow the motion, such as
            spacetime; 0 takes the clip as one window.
    """

    threshold: float = 100.0
    shortest: int = 6
    longest: int = 16
    segment: int = 0


@dataclass(frozen=True)
class Encoder:
    """The encoding of place and time that the MLP reads.

    Attributes:
        space: Resolution of the encoder's coarsest planes along each axis of space, in nodes.
        scales: Number of scales of the encoder; the resolution doubles from scale to scale.
        channels: Features per plane and scale.
        bands: Octaves of the positional encoding that method swings has instead of the encoder.
    """

    space: int = 64
    scales: int = 2
    channels: int = 16
    bands: int = 6


@dataclass(frozen=True)
class Mlp:
    """The tunable MLP, which moves the Gaussians.

    Attributes:
        sets: Number M of sets of weights, which each Gaussian mixes in its own proportions; 1 is a
            plain MLP.
        width: Width of the hidden layers.
        depth: Number of hidden layers.
    """

    sets: int = 2
    width: int = 64
    depth: int = 2


@dataclass(frozen=True)
class Skinning:
    """Additional parameters of Gaussians on a skeleton (methods skinned and hugs).

    Attributes:
        shapes: Number K of residual shapes: changes of positions and colours that are added in
            proportions that depend on the pose; 0 for none.
        hidden: Width of the hidden layer of the network that computes these proportions.
        dropout: Share of the steps, 0 to 1, that learn without the residual shapes, so that the
            body looks right without them, too.
        light: Let colours depend on the direction in which the posed surface faces.
        shadow: Find the strongest lamp and let the body cast shadows on itself in its light; only
            with light.
    """

    shapes: int = 8
    hidden: int = 32
    dropout: float = 0.1
    light: bool = True
    shadow: bool = True


@dataclass(frozen=True)
class Loss:
    """Weights of the terms of the loss.

    Attributes:
        ssim: Weight λ_s of 1 − SSIM; the L1 difference has the weight λ_1 = 1 − λ_s.
        mask: Weight λ_m of the L1 difference of rendered alpha and mask.
        squares: Weight of the mean squared difference of the pictures. Not in the paper.
        smoothness: Weight of the squared second differences of the encoder's planes. Not in the
            paper.
        stillness: Weight of how far the encoder's planes along time are from 1, the value at which
            nothing moves. Not in the paper.
        joints: Weight of the squared displacements, in m², of a skinned body's joints at rest, so
            that joints that hardly turn stay where they were tracked.
    """

    ssim: float = 0.2
    mask: float = 0.1
    squares: float = 0.0
    smoothness: float = 0.0
    stillness: float = 0.0
    joints: float = 1.0


@dataclass(frozen=True)
class Rates:
    """Learning rates at the first step, and the factors to which they decay until the last one.

    Attributes:
        position: Learning rate of the Gaussians' centres, relative to the person's extent.
        position_decay: Factor to which the rate of the centres has decayed at the last step.
        rotation: Learning rate of the Gaussians' rotations (quaternions).
        scale: Learning rate of the logarithms of the Gaussians' sizes.
        opacity: Learning rate of the opacities' logits.
        color: Learning rate of the colours' logits; that of harmonics above degree 0 is a
            twentieth.
        shape_decay: Factor to which the rates of rotations, sizes, opacities and colours have
            decayed at the last step.
        mlp: Learning rate of the MLP.
        grid: Learning rate of the encoder's planes.
        blend: Learning rate of α, by which a Gaussian mixes the MLP's sets of weights.
        motion: Learning rate of the formulas that move the Gaussians of methods spacetime and
            freetime.
        motion_decay: Factor to which the rates of MLP, planes, α and formulas have decayed at the
            last step.
        pose: Learning rate of a skinned body's poses, as quaternions.
        root: Learning rate of a skinned body's root positions, metres.
        joints: Learning rate of the positions of a skinned body's joints at rest, metres.
        pose_decay: Factor to which the rates of poses, roots and joints have decayed at the last
            step.
        shape_means: Learning rate of the positions of residual shapes, metres.
        shape_colors: Learning rate of the colours of residual shapes, logits.
        light: Learning rate of a skinned body's light, and of the strength of its lamp.
        coefficients: Learning rate of the network that mixes residual shapes by the pose.
        skin_decay: Factor to which the rates of residual shapes, their network and light have
            decayed at the last step.
    """

    position: float = 1.6e-4
    position_decay: float = 0.01
    rotation: float = 1e-3
    scale: float = 5e-3
    opacity: float = 5e-2
    color: float = 1e-2
    shape_decay: float = 1.0
    mlp: float = 1e-4
    grid: float = 1.6e-3
    blend: float = 1e-4
    motion: float = 1e-3
    motion_decay: float = 0.1
    pose: float = 1e-3
    root: float = 1e-3
    joints: float = 5e-4
    pose_decay: float = 0.05
    shape_means: float = 2e-4
    shape_colors: float = 5e-3
    light: float = 5e-3
    coefficients: float = 2e-3
    skin_decay: float = 0.2

    def by_parameter(self) -> dict[str, Rate]:
        """Learning rates by name of the parameter; that of `means` is per metre of extent."""
        return {
            "means": Rate(self.position, self.position_decay),
            "quats": Rate(self.rotation, self.shape_decay),
            "log_scales": Rate(self.scale, self.shape_decay),
            "opacity_logits": Rate(self.opacity, self.shape_decay),
            "color_logits": Rate(self.color, self.shape_decay),
            "harmonics": Rate(self.color * REST_FACTOR, self.shape_decay),
            "alpha": Rate(self.blend, self.motion_decay),
            "mlp": Rate(self.mlp, self.motion_decay),
            "grid": Rate(self.grid, self.motion_decay),
            "motion": Rate(self.motion, self.motion_decay),
            "pose_rotations": Rate(self.pose, self.pose_decay),
            "pose_roots": Rate(self.root, self.pose_decay),
            "rig_joints": Rate(self.joints, self.pose_decay),
            "shape_means": Rate(self.shape_means, self.skin_decay),
            "shape_colors": Rate(self.shape_colors, self.skin_decay),
            "light": Rate(self.light, self.skin_decay),
            "lamp_strength": Rate(self.light, self.skin_decay),
            "coefficients": Rate(self.coefficients, self.skin_decay),
        }


@dataclass(frozen=True)
class Initial:
    """The Gaussians that a window's training begins with.

    Attributes:
        source: Where Gaussians begin: on the best surface that the capture has, or on the visual
            hull of the masks.
        gaussians: Number of Gaussians.
        opacity: Opacity of each Gaussian, 0 to 1.
        scale: Size of each Gaussian, relative to its distance to its neighbours.
        duration: Duration of Gaussians of methods spacetime and freetime, relative to that of the
            window.
    """

    source: Source = "best"
    gaussians: int = 50_000
    opacity: float = 0.1
    scale: float = 1.0
    duration: float = 0.15


@dataclass(frozen=True)
class Density:
    """Density control: when Gaussians are added and removed (3DGS, Kerbl et al. 2023, section 5).

    Attributes:
        max_gaussians: Most Gaussians of a window.
        begin: First step at which Gaussians may be added or removed.
        until: Share of a window's steps, 0 to 1, after which none is added or removed.
        every: Steps between two rounds of adding and removing.
        gradient: Mean screen-space gradient (normalised device units) above which a small Gaussian
            is cloned and a large one split.
        growth: Largest share of the Gaussians, 0 to 1, that is cloned or split in one round: those
            with the strongest gradients.
        absgrad: Sum screen-space gradients over a picture's pixels without their signs; four times
            the threshold is usual then.
        min_opacity: Gaussians whose opacity, 0 to 1, is below this are removed; those of method
            freetime are moved to where Gaussians are needed.
    """

    max_gaussians: int = 200_000
    begin: int = 500
    until: float = 0.5
    every: int = 100
    gradient: float = 2e-4
    growth: float = 1.0
    absgrad: bool = False
    min_opacity: float = 0.005


@dataclass(frozen=True)
class Finetune:
    """Temporal fine-tuning, which makes each window agree with the window before it.

    Attributes:
        steps: Optimisation steps per window; 0 for no fine-tuning.
        consistency: Share of the steps, 0 to 1, that compare with the window before; the others
            learn from recorded pictures.
        begin: Point of the decay of learning rates at which fine-tuning begins: 0 for the rates at
            the beginning of the window's training, 1 for those at its end.
        mean: Share of the steps, 0 to 1, counted from the end, over which Gaussians are averaged
            for the result; 0 takes the Gaussians of the last step.
    """

    steps: int = 20_000
    consistency: float = 0.75
    begin: float = 0.0
    mean: float = 0.0


@dataclass(frozen=True)
class BodySettings:
    """How a body is trained; defaults are the paper's and, where the paper gives none, 3DGS's.

    Attributes:
        steps: Optimisation steps of a window, one picture each.
        steps_per_frame: Optimisation steps per frame of a window, instead of --steps; 0 gives each
            window the same number, --steps.
        warmup_steps: Number of first steps of a window that learn from its middle frame alone,
            without motion.
        unfolding: Share of a window's steps, 0 to 1, after the warm-up, in which its frames join
            from the middle one outwards, each with the encoder's features of its neighbour; 0 lets
            all frames join at once. Not in the paper.
        sh_degree: Degree of the spherical harmonics, 0 to 3, by which colours depend on the
            direction of view in the world; bundles keep degree 0. Not on a skeleton.
        sh_every: Steps between two increases of the degree that is trained, which starts at 0.
        color_correction: Let each camera learn an affine map of colours, for cameras whose colours
            differ; the mean over cameras is the identity, with which test cameras are drawn.
        checkpoint_every: Steps from one checkpoint to the next.
        cache_gib: Memory for recorded pictures, GiB, or auto for half of what is free; what does
            not fit is read again, in the background, before each use.
        cache_dir: Folder on a disk with room where pictures that do not fit in memory are kept
            decoded while training runs, instead of being read again.
        windows: Where the clip is cut into windows.
        encoder: The encoding of place and time that the MLP reads.
        mlp: The tunable MLP, which moves the Gaussians.
        skinning: Additional parameters of Gaussians on a skeleton (methods skinned and hugs).
        loss: Weights of the terms of the loss.
        rates: Learning rates, and the factors to which they decay.
        initial: The Gaussians that a window's training begins with.
        density: When Gaussians are added and removed (3DGS, Kerbl et al. 2023, section 5).
        finetune: Temporal fine-tuning, which makes each window agree with the window before it.
    """

    steps: int = 30_000
    steps_per_frame: int = 0
    warmup_steps: int = 1_000
    unfolding: float = 0.0
    sh_degree: int = 0
    sh_every: int = 1_000
    color_correction: bool = False
    checkpoint_every: int = 1_000
    cache_gib: float | Literal["auto"] = "auto"
    cache_dir: str = ""
    windows: Windows = Windows()
    encoder: Encoder = Encoder()
    mlp: Mlp = Mlp()
    skinning: Skinning = Skinning()
    loss: Loss = Loss()
    rates: Rates = Rates()
    initial: Initial = Initial()
    density: Density = Density()
    finetune: Finetune = Finetune()

    def steps_of(self, frames: int) -> int:
        """Optimisation steps of a window of this many frames."""
        return self.steps_per_frame * frames if self.steps_per_frame else self.steps

    def without_finetuning(self) -> "BodySettings":
        """These settings without temporal fine-tuning."""
        return replace(self, finetune=replace(self.finetune, steps=0))


PRESETS: dict[PresetName, BodySettings] = {
    "paper": BodySettings(),
    "cpu": BodySettings(
        steps=2_150,
        warmup_steps=200,
        unfolding=0.3,
        checkpoint_every=500,
        encoder=Encoder(space=32),
        loss=Loss(squares=8.0),
        rates=Rates(
            position=1e-3,
            position_decay=0.03,
            scale=1e-2,
            opacity=3e-2,
            mlp=2e-3,
            grid=2e-2,
            blend=1e-3,
            motion=5e-3,
        ),
        initial=Initial(gaussians=4_000, opacity=0.3),
        density=Density(max_gaussians=7_000, begin=200, gradient=0.0, growth=0.12, absgrad=True),
        finetune=Finetune(steps=3_500, begin=0.5, mean=0.5),
    ),
}


STEPS_PER_FRAME = 150
"""Steps per frame of skinned bodies in the preset `cpu`: their one window may have any length."""
SEGMENT = 45
"""Frames of a segment of Spacetime Gaussians in the preset `paper`: more did not fit into memory.

Segments were trained apart there, without fine-tuning.
"""


def settings_for(preset: PresetName, method: Method) -> BodySettings:
    """The settings of a preset for a method; other methods differ as their own papers do."""
    settings = PRESETS[preset]
    if method == "swings":
        return replace(settings, mlp=replace(settings.mlp, depth=4), unfolding=0.0)
    if method == "spacetime" and preset == "paper":
        windows = replace(settings.windows, segment=SEGMENT)
        return replace(settings.without_finetuning(), windows=windows)
    if method == "4dgs":
        return replace(settings, mlp=replace(settings.mlp, sets=1))
    if method in SKINNED:
        skinning, steps_per_frame = settings.skinning, settings.steps_per_frame
        if method == "hugs":
            skinning = replace(skinning, shapes=0, light=False, shadow=False)
        if preset == "cpu":
            steps_per_frame = STEPS_PER_FRAME
        rates = replace(settings.rates, position_decay=0.1, shape_decay=0.2)
        return replace(settings, skinning=skinning, rates=rates, steps_per_frame=steps_per_frame)
    return settings
