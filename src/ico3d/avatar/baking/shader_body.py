"""Baking: the exact moving body → windows that a shader blends (docs/bundle.md, body/0000 …)."""

from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar.baking.motion_clusters import Channel, components, group
from ico3d.avatar.moving import MovingBody
from ico3d.bundle.body import QUAT_UNIT, BakedWindow
from ico3d.errors import BundleError
from ico3d.splat.convention import MIN_ALPHA
from ico3d.splat.gaussians import Gaussians

_INT16 = 32767
SAMPLES_PER_FRAME = 2
"""All frames, and what lies midway."""
_MOST_FADING = 0.02
"""How much an opacity may change within a window, which has but one; more would be seen."""
GAUSSIANS_PER_CLUSTER = 140
"""At least, on average: each cluster's curves take their room, too."""


@dataclass(frozen=True)
class Shape:
    """How closely a window is kept.

    Attributes:
        clusters: Groups of Gaussians with components of their own; at most one per
            `GAUSSIANS_PER_CLUSTER`.
        ranks: Components of positions, rotations and scales.
    """

    clusters: int
    ranks: tuple[int, int, int]


@dataclass(frozen=True)
class _Motion:
    """What moves in a window: (S, N, 3) metres, (S, N, 4) quaternions, (S, N, 3) metres."""

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray


class WindowBaker:
    """Does what all ranks share once: samples a window densely in time."""

    def __init__(self, body: MovingBody, index: int):
        """Samples window `index`.

        Raises:
            BundleError: If nothing of it is ever opaque enough to be drawn, or if Gaussians come
                and go.
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
        """The window in this shape."""
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
        """What moves, weighted by how far an error moves a Gaussian's rim, times its opacity.

        A turn by the angle θ is a change of the quaternion by θ/2, and moves the rim by θ times
        how far the Gaussian is from a sphere.
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
    """mean + Σ_k curves_sck · basis_kn: (N, D) float32, (K, N, D) int16, (S, C, K) float32."""

    mean: np.ndarray
    basis: np.ndarray
    curves: np.ndarray


def _components(channel: Channel, labels: np.ndarray, count: int) -> _Components:
    """Each cluster's principal components, 16-bit; the curves take on their units."""
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
    """(N, 4) uint8 of colours and opacities."""
    assert gaussians.colors is not None
    rgba = torch.cat([gaussians.colors, gaussians.opacities[:, None]], 1).float().cpu()
    return (rgba.clamp(0, 1) * 255).round().byte().numpy()
