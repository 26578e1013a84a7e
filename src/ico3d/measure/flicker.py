"""Measures how much a body jumps at the border of two windows."""

from collections.abc import Sequence

import numpy as np
import torch
from rich.progress import track

from ico3d.body.model_folder import TrainedBody
from ico3d.body.training.novel_views import novel_camera
from ico3d.common.camera import Camera
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

NOVEL_CAMERAS = 20


def novel_cameras(recorded: Sequence[Camera], count: int = NOVEL_CAMERAS) -> list[Camera]:
    """Cameras between the recorded ones; the same at every call."""
    return [novel_camera(recorded, np.random.default_rng([count, k])) for k in range(count)]


@torch.no_grad()
def border_flicker(body: TrainedBody, cameras: Sequence[Camera]) -> list[float]:
    """Difference between the two windows at each border, in the frame that both of them show.

    Args:
        body: The trained body, with W windows.
        cameras: Cameras that look at the body (see `novel_cameras`).

    Returns:
        W − 1 values of `masked_difference`, means over the cameras.
    """
    borders = range(len(body.windows) - 1)
    return [
        float(np.mean([_difference(before, after, camera) for camera in cameras]))
        for before, after in (
            (body.window_gaussians(index, 1.0), body.window_gaussians(index + 1, 0.0))
            for index in track(borders, "window borders", transient=True)
        )
    ]


def masked_difference(
    first: np.ndarray, second: np.ndarray, first_alpha: np.ndarray, second_alpha: np.ndarray
) -> float:
    """L1 difference per pixel of the person: Σ |a − b| / (3·Σ m), m being the larger alpha.

    Pixels outside of both silhouettes do not differ and need no mask. Two pictures that differ by a
    constant colour on the person have that constant as their difference.

    Args:
        first: (H, W, 3) picture on black.
        second: (H, W, 3) the other picture on black.
        first_alpha: (H, W) alpha of the first picture.
        second_alpha: (H, W) alpha of the second picture.
    """
    area = np.maximum(first_alpha, second_alpha).sum(dtype=np.float64)
    error = np.abs(first - second).sum(dtype=np.float64)
    return float(error / (3 * area)) if area > 0 else 0.0


def _difference(before: Gaussians, after: Gaussians, camera: Camera) -> float:
    """`masked_difference` of two sets of Gaussians seen by one camera."""
    pictures = [render(gaussians, [camera]) for gaussians in (before, after)]
    colors = [picture.rgb[0].clamp(0, 1).cpu().numpy() for picture in pictures]
    alphas = [picture.alpha[0].cpu().numpy() for picture in pictures]
    return masked_difference(*colors, *alphas)
