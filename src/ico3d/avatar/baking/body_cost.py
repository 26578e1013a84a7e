"""What baking costs a body: PSNR of exact and baked windows, to each other and the recording."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np
import torch

from ico3d.avatar.baked_body import window_gaussians
from ico3d.avatar.baking.head_cost import drop, mean_of
from ico3d.avatar.baking.shader_body import SAMPLES_PER_FRAME
from ico3d.avatar.clip_views import VIEWS, At, View, drawn
from ico3d.avatar.moving import MovingBody, Span
from ico3d.avatar.staging import NEUTRAL
from ico3d.bundle.manifest import Loss
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.common.camera import Camera, look_at
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.splat.gaussians import Gaussians, cat

HeadAt = Callable[[float], Gaussians]
"""Returns the head's Gaussians in the world at a frame of the body."""
MAX_DROP = 0.1
"""Most dB, on the person against ground truth, that a baked body may lose."""
MIN_LIKENESS = 42.5
"""Least PSNR in dB of the baked to the exact model where there is no ground truth.

A model with a PSNR of 26 dB to the truth loses 0.1 dB by an independent error of this size.
"""
_PROBE_SIZE, _PROBE_FOV = 256, 40.0
"""Side in pixels, and field of view in degrees, of rendered pictures without a recording."""


def probe_views(cameras: Sequence[Camera], span: Span, count: int = VIEWS) -> list[View]:
    """Views at times midway between those that baking samples, from the cameras in turn.

    Args:
        cameras: Cameras in the world.
        span: The window.
        count: Number of views at most.
    """
    intervals = SAMPLES_PER_FRAME * (span.last - span.first)
    return [
        View(cameras[i % len(cameras)], (interval + 0.5) / intervals, torch.tensor(NEUTRAL))
        for i, interval in enumerate(spread(intervals, count))
    ]


def ring_of_cameras(low: np.ndarray, high: np.ndarray, count: int = 4) -> list[Camera]:
    """Cameras on a level circle around a box, in a world with y up.

    Args:
        low: (3,) least coordinates of the box.
        high: (3,) greatest coordinates of the box.
        count: Number of cameras.
    """
    middle = (low + high) / 2
    distance = 0.6 * np.linalg.norm(high - low) / np.tan(np.deg2rad(_PROBE_FOV) / 2)
    focal = 0.5 * _PROBE_SIZE / np.tan(np.deg2rad(_PROBE_FOV) / 2)
    half = _PROBE_SIZE / 2
    intrinsics = np.array([[focal, 0, half], [0, focal, half], [0, 0, 1]])
    angles = 2 * np.pi * np.arange(count) / count
    eyes = [middle + distance * np.array([np.sin(a), 0.0, np.cos(a)]) for a in angles]
    return [Camera(_PROBE_SIZE, _PROBE_SIZE, intrinsics, look_at(e, middle)) for e in eyes]


def measure_window(
    body: MovingBody,
    index: int,
    baked: BakedWindow,
    recorded: Iterable[View],
    probes: Iterable[View],
    head: HeadAt | None = None,
) -> Loss:
    """Mean PSNR of a baked window on the person: to the recording, and to the exact model.

    Args:
        body: The exact body.
        index: Index of the window.
        baked: The baked window.
        recorded: Views with recorded pictures.
        probes: Views in which baked and exact model are compared.
        head: Returns the exact head on the body; None where there is no head.
    """
    at = partial(window_gaussians, baked)
    return measure(*window_pair(body, index, at, head), recorded, probes)


def window_pair(body: MovingBody, index: int, baked: At, head: HeadAt | None) -> tuple[At, At]:
    """Functions of τ: the exact and the baked window, each with the exact head if there is one.

    Both return Gaussians on the device of the exact body.

    Args:
        body: The exact body.
        index: Index of the window.
        baked: Returns the baked window at τ.
        head: Returns the exact head on the body; None where there is no head.
    """
    span = body.windows[index]

    def together(gaussians: Gaussians, tau: float) -> Gaussians:
        frame = span.first + tau * (span.last - span.first)
        return gaussians if head is None else cat([gaussians, head(frame)])

    device = body.window_gaussians(index, 0.0).means.device
    return (
        lambda tau: together(body.window_gaussians(index, tau), tau),
        lambda tau: together(baked(tau).to(device), tau),
    )


def measure(exact: At, baked: At, recorded: Iterable[View], probes: Iterable[View]) -> Loss:
    """Mean PSNR on the person: of both models to the recording, and of baked to exact.

    Args:
        exact: Returns the exact model at τ.
        baked: Returns the baked model at τ.
        recorded: Views with recorded pictures.
        probes: Views in which baked and exact model are compared, on pixels that the exact model
            covers.
    """
    exact_psnr, baked_psnr, likeness = [], [], []
    for view in recorded:
        assert view.truth is not None
        model, ours = drawn(exact, view)[0], drawn(baked, view)[0]
        exact_psnr.append(psnr(model, view.truth, view.mask))
        baked_psnr.append(psnr(ours, view.truth, view.mask))
    for view in probes:
        model, alpha = drawn(exact, view)
        if alpha.any():
            likeness.append(psnr(drawn(baked, view)[0], model, alpha))
    return Loss(mean_of(exact_psnr), mean_of(baked_psnr), mean_of(likeness))


def loses_at_most(loss: Loss, most: float) -> bool:
    """Whether a loss is at most `most` dB; without ground truth, whether `MIN_LIKENESS` is kept."""
    lost = drop(loss)
    if lost is None:
        return (loss.psnr_baked_vs_exact or 0.0) >= MIN_LIKENESS
    return lost <= most


def comparison_line(exact: At, baked: At, view: View) -> np.ndarray:
    """[recorded |] exact | baked of one view, side by side: (H, W·3 or W·2, 3) float32."""
    pictures = [drawn(model, view)[0] for model in (exact, baked)]
    return np.hstack(pictures if view.truth is None else [view.truth, *pictures])
