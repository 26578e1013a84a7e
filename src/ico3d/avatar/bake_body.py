"""Baking: the exact moving body → windows that a shader blends (design section 3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

from ico3d.avatar.bake_head import LEAST_ALPHA
from ico3d.avatar.lowrank import factorise
from ico3d.bundle.body import QUAT_UNIT, BakedWindow
from ico3d.errors import BundleError
from ico3d.splat.gaussians import Gaussians

INT8 = 127
LEAST_UNIT = 2.0**-14
"""Relative to the Gaussian that moves farthest; float16 holds smaller ones coarsely."""
SAMPLES_PER_FRAME = 2
"""All frames, and what lies midway."""
_LEAST_SCALE = 2e-4
"""Metres; nobody sees whether a Gaussian is smaller, and components would be spent on it."""


class Span(Protocol):
    """Frames first … last, both included."""

    @property
    def first(self) -> int:
        """The first frame."""
        ...

    @property
    def last(self) -> int:
        """The last frame."""
        ...


class MovingBody(Protocol):
    """What is baked: `ico3d.body.trained.TrainedBody`, or anything that moves like it.

    Attributes:
        fps: Frames per second.
        summary: How it was made; `capture` is the provenance of its recording.
    """

    fps: float
    summary: dict

    @property
    def windows(self) -> Sequence[Span]:
        """Spans of time with Gaussians of their own; neighbours share one frame."""
        ...

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window at τ in [0, 1], with `colors`; always equally many."""
        ...


@dataclass(frozen=True)
class _Motion:
    """What moves in a window: (S, N, 3), (S, N, 4), (S, N, 3)."""

    means: np.ndarray
    quats: np.ndarray
    log_scales: np.ndarray


class WindowBaker:
    """Does what all ranks share once: samples a window densely in time."""

    def __init__(self, body: MovingBody, index: int):
        """Samples window `index`.

        Raises:
            BundleError: If nothing of it is ever opaque enough to be drawn.
        """
        span = body.windows[index]
        first = body.window_gaussians(index, 0.0).detach()
        kept = first.drawable() & (first.opacities >= LEAST_ALPHA)
        if not kept.any():
            raise BundleError(f"window {index} has no Gaussian that is ever seen: train it again.")
        self._rgba = _display_colours(first[kept])
        count = SAMPLES_PER_FRAME * (span.last - span.first) + 1
        self._motion = _sample(body, index, kept, count)

    def baked(self, ranks: tuple[int, int, int]) -> BakedWindow:
        """The window with so many components of positions, rotations and log-scales."""
        shown = self._rgba[:, 3] / np.float32(255)  # (N,) whose errors are seen
        position = _components(self._motion.means, shown, ranks[0])
        rotation = _components(self._motion.quats, shown, ranks[1])
        scale = _components(self._motion.log_scales, shown, ranks[2])
        return BakedWindow(
            means=position.mean,
            quats=np.rint(rotation.mean * QUAT_UNIT).astype(np.int16),
            scales=scale.mean.astype(np.float16),
            rgba=self._rgba,
            units=np.stack([position.units, rotation.units, scale.units], 1),
            position_basis=position.basis,
            rotation_basis=rotation.basis,
            scale_basis=scale.basis,
            coefficients=np.hstack([position.scores, rotation.scores, scale.scores]),
        )


def _sample(body: MovingBody, index: int, kept: torch.Tensor, count: int) -> _Motion:
    samples = []
    with torch.no_grad():
        for tau in np.linspace(0, 1, count):
            now = body.window_gaussians(index, float(tau))[kept]
            values = (now.means, now.quats, now.scales.clamp_min(_LEAST_SCALE).log())
            samples.append([value.float().cpu().numpy() for value in values])
    means, quats, log_scales = (np.stack(part) for part in zip(*samples, strict=True))
    return _Motion(means, aligned(quats), log_scales)


def aligned(quats: np.ndarray) -> np.ndarray:
    """Unit quaternions (S, N, 4) whose signs do not jump over time: q and −q are one rotation."""
    unit = quats / np.maximum(np.linalg.norm(quats, axis=-1, keepdims=True), 1e-12)
    flips = (unit[1:] * unit[:-1]).sum(-1, keepdims=True) < 0  # (S − 1, N, 1)
    signs = np.cumprod(np.where(flips, -1, 1), axis=0)
    return np.concatenate([unit[:1], unit[1:] * signs]).astype(np.float32)


@dataclass(frozen=True)
class _Components:
    """Y ≈ mean + units · Σ_k scores_k · basis_k.

    Attributes:
        mean: (N, D) float32.
        units: (N,) float16, at most 1.
        basis: (K, N, D) int8.
        scores: (S, K) float32.
    """

    mean: np.ndarray
    units: np.ndarray
    basis: np.ndarray
    scores: np.ndarray


def _components(samples: np.ndarray, weights: np.ndarray, rank: int) -> _Components:
    """Principal components over time of (S, N, D), 8-bit.

    Every Gaussian has a unit of its own: few move far. Components are as long as the motion along
    them, so that the first, which matter most, use the range of the integers. Weights (N,) say
    how much a Gaussian's errors matter.
    """
    steps, count, size = samples.shape
    flat = samples.reshape(steps, count * size)
    factors = factorise(flat, weights.repeat(size), rank)
    lengths = np.linalg.norm(factors.scores, axis=0)  # (K,)
    lengths = np.where(lengths > 0, lengths, 1).astype(np.float32)
    basis = (factors.basis * lengths[:, None]).reshape(rank, count, size)
    reach = np.abs(basis).max(axis=(0, 2))  # (N,)
    farthest = max(float(reach.max()), np.finfo(np.float32).tiny)
    units = np.maximum(reach / farthest, LEAST_UNIT).astype(np.float16)
    step = farthest / INT8 * units.astype(np.float32)  # (N,) what 1 stands for
    whole = np.clip(np.rint(basis / step[:, None]), -INT8, INT8).astype(np.int8)
    mean, scores = factors.mean.reshape(count, size), factors.scores / lengths
    return _Components(mean, units, whole, scores * np.float32(farthest / INT8))


def _display_colours(gaussians: Gaussians) -> np.ndarray:
    """(N, 4) uint8 of colours and opacities."""
    assert gaussians.colors is not None
    rgba = torch.cat([gaussians.colors, gaussians.opacities[:, None]], 1).float().cpu()
    return (rgba.clamp(0, 1) * 255).round().byte().numpy()
