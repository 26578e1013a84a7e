"""Rendering Gaussians: one contract, a CPU (numba) and a CUDA (gsplat) backend.

The convention: pixel centres at +0.5. A splat's 2D covariance Σ is blurred to Σ + 0.3·I, and its
opacity multiplied by √(det Σ / det(Σ + 0.3·I)), so that small splats keep their light (the
anti-aliasing of Mip-Splatting; gsplat's "antialiased"). A splat ends where its alpha is under
1/255; alpha is at most 0.999; a pixel is finished at transmittance 10⁻⁴; nothing nearer than 0.01 m
is drawn. The projection's Jacobian is taken at most 0.3 half images outside of the picture.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.rendering import Drawing, Rendering


def render(
    gaussians: Gaussians, cameras: Sequence[Camera], background: Tensor | None = None
) -> Rendering:
    """Renders Gaussians, differentiably in all of their parameters.

    The backend follows the tensors' device: CPU runs numba kernels, CUDA runs gsplat. Computation
    is float32.

    Args:
        gaussians: N ≥ 0 Gaussians in world space.
        cameras: C ≥ 1 cameras of one size.
        background: What lies behind: None for black, (3,), (H, W, 3) or (C, H, W, 3).

    Returns:
        Pictures (C, H, W, 3), alpha, depth, and what density control needs. Gaussians behind a
        camera are not drawn; without Gaussians the background is left.

    Raises:
        ValueError: If cameras differ in size, there is none, or a shape does not fit.
        MissingExtraError: If the tensors are on a CUDA device and gsplat is not installed.
    """
    _check(gaussians, cameras, background)
    gaussians = gaussians.map(Tensor.float)
    drawing = _draw(gaussians, _view_colors(gaussians, cameras), cameras)
    rgb = drawing.rgb
    if background is not None:
        behind = background.to(rgb)
        rgb = rgb + (1 - drawing.alpha)[..., None] * behind  # (C, H, W, 3)
    return Rendering(rgb, drawing.alpha, drawing)


def _draw(gaussians: Gaussians, colors: Tensor, cameras: Sequence[Camera]) -> Drawing:
    """Draws with the backend of the tensors' device."""
    if gaussians.means.is_cuda:
        from ico3d.splat import cuda as backend
    else:
        from ico3d.splat.cpu import backend
    return backend.draw_gaussians(gaussians, colors, cameras)


def _view_colors(gaussians: Gaussians, cameras: Sequence[Camera]) -> Tensor:
    """(C, N, 3) colours that the cameras see."""
    shape = (len(cameras), len(gaussians), 3)
    if gaussians.colors is not None:
        return gaussians.colors.expand(shape)
    assert gaussians.sh is not None
    centers = np.stack([camera.camera_to_world[:3, 3] for camera in cameras])  # (C, 3)
    eyes = torch.from_numpy(centers).to(gaussians.means)
    directions = gaussians.means - eyes[:, None]  # (C, N, 3)
    return harmonics.to_colors(gaussians.sh, directions).expand(shape)


def _check(gaussians: Gaussians, cameras: Sequence[Camera], background: Tensor | None) -> None:
    """Raises ValueError where `render` says so."""
    if not cameras:
        raise ValueError("render needs at least one camera")
    sizes = {(camera.height, camera.width) for camera in cameras}
    if len(sizes) > 1:
        raise ValueError(f"cameras of one render must have one size, got {sorted(sizes)}")
    count = len(gaussians)
    shapes = {"means": (3,), "quats": (4,), "scales": (3,), "opacities": ()}
    for name, shape in shapes.items():
        if getattr(gaussians, name).shape != (count, *shape):
            raise ValueError(f"{name} of {count} Gaussians must have shape {(count, *shape)}")
    if (gaussians.colors is None) == (gaussians.sh is None):
        raise ValueError("Gaussians must have either colors or sh")
    image = (*sizes.pop(), 3)
    if background is not None and tuple(background.shape) not in (
        (3,),
        image,
        (len(cameras), *image),
    ):
        raise ValueError(f"a background must be (3,), {image} or one per camera")
