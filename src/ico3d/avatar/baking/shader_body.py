"""Bakes windows of an exact moving body into bases that a shader mixes.

docs/bundle.md describes the files body/0000 … that result.
"""

from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar.baking.motion_clusters import Channel, components, group
from ico3d.avatar.moving import MovingBody
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.errors import BundleError
from ico3d.splat.convention import MIN_ALPHA
from ico3d.splat.gaussians import Gaussians

_INT16 = 32767
SAMPLES_PER_FRAME = 2
"""Times at which a window is sampled, per frame: all frames, and midway between them."""
_MOST_FADING = 0.02
"""Most change of an opacity within a window: a baked window keeps one value for all times."""
GAUSSIANS_PER_CLUSTER = 140
"""Least mean number of Gaussians in a cluster: each cluster's curves take memory, too."""


@dataclass(frozen=True)
class Shape:
    """How closely a window is kept.

    Attributes:
        clusters: Number of groups of Gaussians with components of their own; fewer where a group
            would have less than `GAUSSIANS_PER_CLUSTER` on average.
        ranks: Number of components of positions, of rotations and of scales.
    """

    clusters: int
    ranks: tuple[int, int, int]


@dataclass(frozen=True)
class _Motion:
    """The Gaussians of a window at S times.

    Attributes:
        means: (S, N, 3) metres.
        quats: (S, N, 4) unit quaternions wxyz, whose signs do not jump over time.
        scales: (S, N, 3) metres.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray


class WindowBaker:
    """Bakes one window in any shape; the window is sampled once, densely in time."""

    def __init__(self, body: MovingBody, index: int):
        """Samples window `index` of a body.

        Raises:
            BundleError: If no Gaussian of the window is opaque enough to be drawn, or if the
                opacity of one changes within the window.
        """
        span = body.windows[index]
        first = body.window_gaussians(index, 0.0).detach()
        kept = first.drawable() & (first.opacities >= MIN_ALPHA)
        if not kept.any():
            raise BundleError(f"window {index} has no Gaussian that is ever seen: train it again.")
        self._rgba = _display_colours(first[kept])
        count = SAMPLES_PER_FRAME * (span.last - span.first) + 1
        self._motion = _sample(body, index, first, kept, count)

    def baked(self, shape: Shape) -> BakedWindow:
        """The window, baked in a shape."""
        channels = self._channels(shape.ranks)
        count = max(1, min(shape.clusters, len(self._rgba) // GAUSSIANS_PER_CLUSTER))
        labels = group(channels, count)
        position, rotation, scale = (_components(c, labels, count) for c in channels)
        return BakedWindow(
            means=position.mean,
            quats=np.rint(rotation.mean * QUAT_UNIT).astype(np.int16),
            scales=scale.mean.astype(np.float16),
            rgba=self._rgba,
            clusters=labels,
            position_basis=position.basis,
            rotation_basis=rotation.basis,
            scale_basis=scale.basis,
            coefficients=np.concatenate([position.curves, rotation.curves, scale.curves], 2),
        )

    def _channels(self, ranks: tuple[int, int, int]) -> list[Channel]:
        """Positions, rotations and scales, each with the weight of its errors.

        The weight of a Gaussian is how far an error of size 1 moves its rim, in metres, times its
        opacity. A rotation by the angle θ changes the quaternion by θ/2 and moves the rim by about
        θ times the eccentricity, √(largest² − smallest²) of the Gaussian's scales.
        """
        motion, opacity = self._motion, self._rgba[:, 3] / np.float32(255)
        squares = np.square(motion.scales)  # (S, N, 3)
        eccentricity = np.sqrt((squares.max(axis=2) - squares.min(axis=2)).mean(axis=0))  # (N,)
        weights = (opacity, 2 * eccentricity * opacity, opacity)
        values = (motion.means, motion.quats, motion.scales)
        return [Channel(*part) for part in zip(values, weights, ranks, strict=True)]


def _sample(
    body: MovingBody, index: int, first: Gaussians, kept: torch.Tensor, count: int
) -> _Motion:
    samples = []
    with torch.no_grad():
        for tau in np.linspace(0, 1, count):
            now = body.window_gaussians(index, float(tau))
            _check_constant(first.opacities, now.opacities, index)
            now = now[kept]
            values = (now.means, now.quats, now.scales)
            samples.append([value.float().cpu().numpy() for value in values])
    means, quats, scales = (np.stack(part) for part in zip(*samples, strict=True))
    return _Motion(means, aligned(quats), scales)


def _check_constant(first: torch.Tensor, now: torch.Tensor, index: int) -> None:
    if (first - now).abs().max() > _MOST_FADING:
        raise BundleError(
            f"window {index} has Gaussians that come and go, which bundles cannot hold: "
            "bake a body of another method, such as swings++."
        )


def aligned(quats: np.ndarray) -> np.ndarray:
    """Unit quaternions (S, N, 4) whose signs do not jump over time: q and −q are one rotation."""
    unit = quats / np.maximum(np.linalg.norm(quats, axis=-1, keepdims=True), 1e-12)
    flips = (unit[1:] * unit[:-1]).sum(-1, keepdims=True) < 0  # (S − 1, N, 1)
    signs = np.cumprod(np.where(flips, -1, 1), axis=0)
    return np.concatenate([unit[:1], unit[1:] * signs]).astype(np.float32)


@dataclass(frozen=True)
class _Components:
    """A property over time: mean_n + Σ_k curves_sck · basis_kn, where c is the cluster of n.

    Attributes:
        mean: (N, D) float32 mean over time.
        basis: (K, N, D) int16.
        curves: (S, C, K) float32, at S times for C clusters; they include the units of the basis.
    """

    mean: np.ndarray
    basis: np.ndarray
    curves: np.ndarray


def _components(channel: Channel, labels: np.ndarray, count: int) -> _Components:
    """Principal components of each cluster, with a 16-bit basis.

    Args:
        channel: The property.
        labels: (N,) cluster of each Gaussian.
        count: Number of clusters.
    """
    spans = components(channel, labels, count)  # (C, S, K)
    mean = channel.values.mean(axis=0)
    basis = np.zeros((channel.rank, *mean.shape), np.int16)
    for cluster, span in enumerate(spans):
        chosen = labels == cluster
        parts = np.tensordot(span.T, channel.values[:, chosen] - mean[chosen], 1)  # (K, n, D)
        units = np.abs(parts).max(axis=(1, 2), initial=0) / _INT16  # (K,)
        units[units == 0] = 1
        basis[:, chosen] = np.rint(parts / units[:, None, None])
        span *= units
    return _Components(mean, basis, spans.transpose(1, 0, 2).astype(np.float32))


def _display_colours(gaussians: Gaussians) -> np.ndarray:
    """(N, 4) uint8: RGB and opacity of each Gaussian, from 0 to 255."""
    assert gaussians.colors is not None
    rgba = torch.cat([gaussians.colors, gaussians.opacities[:, None]], 1).float().cpu()
    return (rgba.clamp(0, 1) * 255).round().byte().numpy()
