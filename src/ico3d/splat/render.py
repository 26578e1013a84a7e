"""Renders Gaussians with one of two backends, CPU (numba) or CUDA (gsplat).

Both backends follow one convention. Pixel centres lie at +0.5. A splat's 2D covariance Σ is blurred
to Σ + 0.3·I, and the opacity is multiplied by √(det Σ / det(Σ + 0.3·I)), so that small splats keep
their light (the anti-aliasing of Mip-Splatting; "antialiased" in gsplat). Scenes that other tools
trained without that factor can be drawn without the factor.

A splat ends where its alpha is below 1/255; alpha is at most 0.999; a pixel is finished when its
transmittance falls to 10⁻⁴; Gaussians nearer than 0.01 m are not drawn. The projection's Jacobian
is evaluated at most 0.3 half images outside of the picture.
"""

# pyright: reportUnknownMemberType=false
# (torch leaves some of its functions untyped)

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.rendering import Rendering


def render(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    background: Tensor | None = None,
    *,
    world_to_camera: Tensor | None = None,
    antialiased: bool = True,
    absgrad: bool = False,
) -> Rendering:
    """Renders Gaussians, differentiably in all of their parameters and in the cameras' poses.

    The device of the tensors selects the backend: numba kernels on the CPU, gsplat on CUDA. All
    computation is in float32, whatever the precision of the tensors.

    Args:
        gaussians: N ≥ 0 Gaussians in world space.
        cameras: C ≥ 1 cameras with one picture size.
        background: Colour behind the Gaussians: None for black, (3,), (H, W, 3) or (C, H, W, 3).
        world_to_camera: (C, 4, 4) rigid transforms that replace the cameras' own; may require
            gradients.
        antialiased: Whether a splat's opacity is reduced where the blur enlarges the splat.
        absgrad: Whether `info.screen_gradients()` sums absolute values over pixels.

    Returns:
        Pictures (C, H, W, 3), alpha, depth, and the data for density control. Gaussians behind a
        camera, and those with a parameter that is not finite, are not drawn and get no gradient.
        Without Gaussians the picture is the background.

    Raises:
        ValueError: If there is no camera, the cameras differ in size, or a shape does not fit.
        MissingExtraError: If the tensors are on a CUDA device and gsplat is not installed.
        SettingsError: If gsplat is installed but cannot be used.
    """
    _check(gaussians, cameras, background)
    poses = _poses(cameras, world_to_camera)
    gaussians = _sound(gaussians.map(Tensor.float))
    colors = _view_colors(gaussians, poses)
    backend = _backend(gaussians)
    drawing = backend.draw_gaussians(gaussians, colors, cameras, poses, antialiased, absgrad)
    rgb = drawing.rgb
    if background is not None:
        rgb = backend.put_over(drawing, background.to(rgb))  # (C, H, W, 3)
    return Rendering(rgb, drawing.alpha, drawing)


def _backend(gaussians: Gaussians):
    """The backend of the tensors' device."""
    if gaussians.means.is_cuda:
        from ico3d.splat import cuda as backend
    else:
        from ico3d.splat.cpu import backend
    return backend


def _poses(cameras: Sequence[Camera], world_to_camera: Tensor | None) -> Tensor:
    """(C, 4, 4) float64, world to camera.

    Raises:
        ValueError: If there is not one per camera.
    """
    if world_to_camera is None:
        return torch.from_numpy(np.stack([camera.world_to_camera for camera in cameras]))
    if world_to_camera.shape != (len(cameras), 4, 4):
        raise ValueError(f"world_to_camera must be {(len(cameras), 4, 4)}")
    return world_to_camera.double()


def _sound(gaussians: Gaussians) -> Gaussians:
    """The Gaussians; those with values that are not finite become some that nobody sees."""
    sound = gaussians.drawable()
    if bool(sound.all()):
        return gaussians
    hidden = gaussians.map(torch.zeros_like)
    hidden.quats[:, 0], hidden.scales[:] = 1, 1
    return gaussians.where(sound, hidden)


def _view_colors(gaussians: Gaussians, poses: Tensor) -> Tensor:
    """(C, N, 3) colours that the cameras see."""
    shape = (len(poses), len(gaussians), 3)
    if gaussians.colors is not None:
        return gaussians.colors.expand(shape)
    assert gaussians.sh is not None
    eyes = -(poses[:, :3, :3].mT @ poses[:, :3, 3:])[..., 0]  # (C, 3)
    directions = gaussians.means - eyes.to(gaussians.means)[:, None]  # (C, N, 3)
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
