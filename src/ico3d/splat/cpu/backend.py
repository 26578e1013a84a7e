"""The CPU backend of `splat.render`."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
# (torch leaves some of its functions untyped)

from collections.abc import Sequence

import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat.cpu.rasterise import Draw, Over, Project, bin_views, camera_numbers
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.rendering import Drawing, RenderInfo


def draw_gaussians(
    gaussians: Gaussians,
    colors: Tensor,
    cameras: Sequence[Camera],
    poses: Tensor,
    antialiased: bool,
    absgrad: bool,
) -> Drawing:
    """Draws Gaussians on black, on the CPU.

    Args:
        gaussians: Float32, on the CPU.
        colors: (C, N, 3) colours of the Gaussians as each camera sees them.
        cameras: C cameras with one picture size; only size and intrinsics are used, not their
            poses.
        poses: (C, 4, 4) float64, world to camera.
        antialiased: Whether a splat's opacity is reduced where the low-pass filter enlarges it.
        absgrad: Whether screen-space gradients are also summed over pixels as absolute values.

    Returns:
        The drawing.
    """
    width, height = cameras[0].width, cameras[0].height
    means2d, conics, alphas, depths, extents = Project.apply(
        gaussians.means,
        gaussians.quats,
        gaussians.scales,
        gaussians.opacities,
        camera_numbers(cameras, poses),
        width,
        height,
        antialiased,
    )
    if means2d.requires_grad:
        means2d.retain_grad()
    tiles = bin_views(means2d, conics, alphas, depths, extents, width, height)
    absolute = torch.zeros_like(means2d) if absgrad else None  # (C, N, 2)
    images, light = Draw.apply(means2d, conics, alphas, colors, tiles, absolute)

    def draw_depth() -> Tensor:
        spread = depths[..., None].expand(*depths.shape, 3)  # (C, N, 3)
        return Draw.apply(means2d, conics, alphas, spread, tiles, None)[0][..., 0]  # (C, H, W)

    radii = extents.amax(-1).ceil().int()  # (C, N)
    info = RenderInfo(radii, means2d, width, height, None if absolute is None else lambda: absolute)
    return Drawing(images, 1 - light, draw_depth, info)


def put_over(drawing: Drawing, behind: Tensor) -> Tensor:
    """The pictures (C, H, W, 3) over a background (3,), (H, W, 3) or (C, H, W, 3)."""
    spread = behind.expand_as(drawing.rgb)  # (C, H, W, 3)
    return Over.apply(drawing.rgb, drawing.alpha, spread)  # type: ignore[no-any-return]
