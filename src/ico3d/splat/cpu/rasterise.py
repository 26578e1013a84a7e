"""The kernels as differentiable torch functions."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ico3d.common.camera import Camera
from ico3d.splat.cpu.backward import draw_backward
from ico3d.splat.cpu.forward import draw, splat_records
from ico3d.splat.cpu.geometry import CAMERA_SIZE
from ico3d.splat.cpu.projection import project
from ico3d.splat.cpu.projection_backward import project_backward
from ico3d.splat.cpu.tiles import Tiles, bin_splats


def camera_numbers(cameras: Sequence[Camera]) -> np.ndarray:
    """(C, 16) float64 that the kernels read."""
    numbers = np.empty((len(cameras), CAMERA_SIZE))
    for row, camera in zip(numbers, cameras, strict=True):
        k, matrix = camera.intrinsics, camera.world_to_camera
        row[:4] = k[0, 0], k[1, 1], k[0, 2], k[1, 2]
        row[4:13] = matrix[:3, :3].ravel()
        row[13:] = matrix[:3, 3]
    return numbers


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()


class Project(torch.autograd.Function):
    """Differentiable `cpu.projection.project`; the extents carry no gradient."""

    @staticmethod
    def forward(ctx, means, quats, scales, opacities, cameras, width, height):
        """Returns means2d, conics, opacities left, depths, extents as `project` does."""
        arrays = [_array(t) for t in (means, quats, scales, opacities)]
        results = project(cameras, *arrays, width=width, height=height)
        ctx.problem = (cameras, arrays, width, height, results[2])
        tensors = tuple(torch.from_numpy(r) for r in results)
        ctx.mark_non_differentiable(tensors[4])
        return tensors

    @staticmethod
    @once_differentiable
    def backward(ctx, g_means2d, g_conics, g_alphas, g_depths, _):
        """Gradients of means, quats, scales, opacities."""
        gradients = torch.cat(
            [g_means2d, g_conics, g_alphas[..., None], g_depths[..., None]], -1
        )  # (C, N, 7)
        cameras, arrays, width, height, alphas = ctx.problem
        results = project_backward(
            cameras,
            *arrays,
            width=width,
            height=height,
            alphas=alphas,
            gradients=_array(gradients),
        )
        return *map(torch.from_numpy, results), None, None, None


class Draw(torch.autograd.Function):
    """Differentiable compositing of C cameras' splats."""

    @staticmethod
    def forward(ctx, means2d, conics, alphas, colors, tiles: Sequence[Tiles]):
        """Draws.

        Args:
            ctx: Autograd's.
            means2d: (C, N, 2).
            conics: (C, N, 3).
            alphas: (C, N) opacities after the low-pass.
            colors: (C, N, 3).
            tiles: One per camera.

        Returns:
            Images (C, H, W, 3) on black and transmittances (C, H, W).
        """
        splats = zip(*(map(_array, (means2d, conics, alphas, colors))), strict=True)
        records = [splat_records(*parts) for parts in splats]
        drawn = [draw(r, t) for r, t in zip(records, tiles, strict=True)]
        ctx.problem = (records, tiles, drawn)
        images, lights = zip(*drawn, strict=True)
        return torch.from_numpy(np.stack(images)), torch.from_numpy(np.stack(lights))

    @staticmethod
    @once_differentiable
    def backward(ctx, g_images, g_lights):
        """Gradients of means2d, conics, alphas, colors."""
        views = zip(*ctx.problem, _array(g_images), _array(g_lights), strict=True)
        gradients = torch.from_numpy(
            np.stack(
                [
                    draw_backward(records, tiles, image, light, g_image, g_light)
                    for records, tiles, (image, light), g_image, g_light in views
                ]
            )
        )  # (C, N, 9)
        means2d, conics, alphas, colors = gradients.split([2, 3, 1, 3], -1)
        return means2d, conics, alphas[..., 0], colors, None


def bin_views(
    means2d: Tensor,
    conics: Tensor,
    alphas: Tensor,
    depths: Tensor,
    extents: Tensor,
    width: int,
    height: int,
) -> list[Tiles]:
    """One `Tiles` per camera from the results of `Project`."""
    views = zip(*map(_array, (means2d, conics, alphas, depths, extents)), strict=True)
    return [bin_splats(*view, width=width, height=height) for view in views]
