"""The state in which the training of a window begins, for each method."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from ico3d.body.companion import Companion, Pruning
from ico3d.body.motion.deformation import POSITIONS, Deformation
from ico3d.body.motion.encoder import EncoderShape
from ico3d.body.motion.formulas import FREETIME, SPACETIME, Polynomial, Still
from ico3d.body.motion.tunable import MlpShape
from ico3d.body.motion.window_model import Motion, WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import SKINNED, BodySettings, Method
from ico3d.body.training.begin import Begin, round_gaussians, trespassing
from ico3d.body.training.prepare_skinned import begin_skinned
from ico3d.body.training.surface_points import initial_points
from ico3d.capture.capture import Capture
from ico3d.splat.density import Population
from ico3d.splat.initial import resampled

PADDING = 0.15
"""Margin of the deformation's box on each side of the person's points, relative to their extent.

Positions outside of the box all have the encoder's features at its border.
"""


Dynamic = Callable[[np.ndarray], np.ndarray]
"""Returns for points (P, 3) in the world how much each moves in a window: (P,) from 0 to 1."""


def begin_window(
    capture: Capture,
    window: Window,
    method: Method,
    settings: BodySettings,
    dynamic: Dynamic,
    seed: int,
    companion: Companion | None = None,
) -> Begin:
    """Round Gaussians on the person's surface.

    They begin at the window's centre frame; those of methods spacetime and freetime at all frames.

    Args:
        capture: The recording.
        window: Frames of the window.
        method: How Gaussians are moved.
        settings: Number of Gaussians, and sizes of the deformation.
        dynamic: Tells which points move in this window.
        seed: Seed of the choice of points.
        companion: Other Gaussians, whose space stays empty and near whose border more points begin;
            None for none.

    Raises:
        CaptureError: If the cameras look at no common place, or a skinned body has no body track.
    """
    rng = np.random.default_rng([seed, window.first])
    if method in SKINNED:
        return begin_skinned(capture, window, settings, rng, companion)
    count = min(settings.initial.gaussians, settings.density.max_gaussians)
    if method in ("spacetime", "freetime"):
        frames = range(window.first, window.last + 1)
    else:
        frames = (window.center,)
    clouds, source = _clouds(capture, frames, -(-count // len(frames)), settings, rng)
    if companion is not None:
        pairs = zip(clouds, frames, strict=True)
        clouds = [_beside(companion, cloud, frame, rng) for cloud, frame in pairs]
    points = np.concatenate(clouds)  # (P, 3)
    motion, extra = _motion(method, settings, capture, window, clouds, dynamic, rng)
    gaussians = round_gaussians(capture, frames, clouds, settings) | extra
    generator = torch.Generator().manual_seed(int(rng.integers(2**62)))
    shared = motion.initial(generator) if isinstance(motion, Deformation) else {}
    extent = float(np.ptp(points, axis=0).max() / 2)
    return Begin(WindowModel(motion, gaussians, shared), extent, source)


def continued_window(model: WindowModel, window: Window, companion: Companion | None) -> Begin:
    """A trained window as the beginning of another training.

    Args:
        model: The trained model; Gaussians that trespass are removed in place.
        window: Frames of the window.
        companion: Other Gaussians, whose space stays empty; None for none.
    """
    if companion is not None:
        Pruning(companion, window).carry_out(model, Population(model.gaussians, {}))
    low, high = np.percentile(model.gaussians["means"].numpy(), (0.5, 99.5), axis=0)  # (3,) each
    return Begin(model, float((high - low).max() / 2), "a trained body")


def _clouds(
    capture: Capture,
    frames: Sequence[int],
    each: int,
    settings: BodySettings,
    rng: np.random.Generator,
) -> tuple[list[np.ndarray], str]:
    """For each frame points (each, 3) of its surface, and in words where they come from."""
    starts = [
        initial_points(capture, frame, each, rng, settings.initial.source) for frame in frames
    ]
    return [resampled(start.points, each, rng) for start in starts], starts[0].source


def _beside(
    companion: Companion, points: np.ndarray, frame: int, rng: np.random.Generator
) -> np.ndarray:
    """(Q, 3) points of a frame and near the companion's border, without those that trespass."""
    places = np.concatenate([points, companion.border(frame, rng)])
    return places[~trespassing(companion, places, frame)]


def _motion(
    method: Method,
    settings: BodySettings,
    capture: Capture,
    window: Window,
    clouds: list[np.ndarray],
    dynamic: Dynamic,
    rng: np.random.Generator,
) -> tuple[Motion, dict[str, Tensor]]:
    """The motion of a method, and its initial tensors of the Gaussians."""
    if method == "static":
        return Still(), {}
    if method in ("spacetime", "freetime"):
        formula = SPACETIME if method == "spacetime" else FREETIME
        return formula, _formula_tensors(formula, settings, clouds)
    sampled = [initial_points(capture, f, 500, rng, settings.initial.source) for f in _some(window)]
    motion = deformation(method, settings, window, np.concatenate([s.points for s in sampled]))
    if motion.mlp.sets == 1:
        return motion, {}
    moving = torch.from_numpy(dynamic(clouds[0])).float()  # (P,)
    alpha = moving.new_zeros(len(moving), motion.mlp.sets)  # (P, M)
    alpha[:, 0], alpha[:, 1:] = 1 - moving, moving[:, None] / (motion.mlp.sets - 1)
    return motion, {"alpha": alpha}


def _some(window: Window) -> list[int]:
    """Every third frame of a window, and its last one."""
    return sorted({*range(window.first, window.last, 3), window.last})


def deformation(
    method: Method, settings: BodySettings, window: Window, points: np.ndarray
) -> Deformation:
    """The deformation of a window.

    Args:
        method: swings++, swings or 4dgs.
        settings: Sizes of encoder and MLP.
        window: Frames of the window.
        points: (P, 3) points of the person at several frames, which decide the deformation's box.
    """
    low, high = points.min(0), points.max(0)
    middle, half = (low + high) / 2, (high - low) / 2 * (1 + 2 * PADDING)
    encoder, sizes = None, settings.encoder
    inputs = POSITIONS * (1 + 2 * sizes.bands)
    if method != "swings":
        space = tuple(sizes.space * 2**scale for scale in range(sizes.scales))
        encoder = EncoderShape(space, len(window), sizes.channels)
        inputs = encoder.outputs
    mlp = MlpShape(inputs, settings.mlp.width, settings.mlp.depth, sets=settings.mlp.sets)
    box = tuple(middle.tolist()), tuple(half.tolist())
    return Deformation(*box, mlp, encoder, sizes.bands)


def _formula_tensors(
    formula: Polynomial, settings: BodySettings, clouds: list[np.ndarray]
) -> dict[str, Tensor]:
    """Tensors of Gaussians that are opaque about their cloud's frame and move to the next cloud."""
    steps = max(len(clouds) - 1, 1)
    sizes = [len(cloud) for cloud in clouds]
    center = torch.repeat_interleave(torch.arange(len(clouds)) / steps, torch.tensor(sizes))
    speed = np.concatenate([_speed(clouds, index) for index in range(len(clouds))])  # (P, 3)
    path = torch.zeros(len(speed), formula.degree, 3)
    path[:, 0] = torch.from_numpy(speed).float()
    tensors = {
        "center": center.float(),
        "log_duration": torch.full((len(speed),), math.log(settings.initial.duration)),
        "path": path,
    }
    return tensors | ({"turn": torch.zeros(len(speed), 4)} if formula.turning else {})


def _speed(clouds: list[np.ndarray], index: int) -> np.ndarray:
    """(P, 3) velocity of a cloud's points, in metres per window.

    Each point moves to the nearest point of the next cloud; those of the last cloud come from the
    nearest point of the cloud before.
    """
    steps = max(len(clouds) - 1, 1)
    after = index < len(clouds) - 1
    if steps == 1 and not after and index == 0:
        return np.zeros_like(clouds[0])
    other = clouds[index + 1 if after else index - 1]
    nearest = other[KDTree(other).query(clouds[index])[1]]
    return (nearest - clouds[index]) * (steps if after else -steps)
