"""Torch autograd functions around the numba kernels."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportUnknownParameterType=false
# pyright: reportIncompatibleMethodOverride=false
# (torch leaves some of its functions untyped, and so does numba)

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ico3d.common.camera import Camera
from ico3d.splat.cpu.backward import draw_backward
from ico3d.splat.cpu.compositing import put_over, put_over_backward
from ico3d.splat.cpu.forward import draw, splat_records
from ico3d.splat.cpu.projection import project
from ico3d.splat.cpu.projection_backward import project_backward
from ico3d.splat.cpu.tiles import Tiles, bin_splats


def camera_numbers(cameras: Sequence[Camera], poses: Tensor) -> Tensor:
    """Packs cameras into the (C, 16) float64 that the kernels read.

    Args:
        cameras: C cameras, of which only the intrinsics are used.
        poses: (C, 4, 4) float64, world to camera; gradients reach them.
    """
    k = torch.from_numpy(np.stack([camera.intrinsics for camera in cameras]))  # (C, 3, 3)
    lens = torch.stack([k[:, 0, 0], k[:, 1, 1], k[:, 0, 2], k[:, 1, 2]], -1)  # (C, 4)
    return torch.cat([lens, poses[:, :3, :3].flatten(1), poses[:, :3, 3]], 1)  # (C, 16)


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()


def _stacked(arrays: Sequence[np.ndarray]) -> Tensor:
    """Arrays of one shape as a tensor (C, ...); a single one is not copied."""
    return torch.from_numpy(arrays[0][None] if len(arrays) == 1 else np.stack(arrays))


class Project(torch.autograd.Function):
    """Autograd function for `cpu.projection.project`; extents carry no gradient."""

    @staticmethod
    def forward(
        ctx: Any,
        means: Tensor,
        quats: Tensor,
        scales: Tensor,
        opacities: Tensor,
        cameras: Tensor,
        width: int,
        height: int,
        antialiased: bool,
    ) -> tuple[Tensor, ...]:
        """Returns means2d, conics, opacities, depths and extents, as `project` does."""
        arrays = [_array(t) for t in (cameras, means, quats, scales, opacities)]
        results = project(*arrays, width=width, height=height, antialiased=antialiased)
        ctx.problem = (arrays, width, height, antialiased, results[2])
        tensors = tuple(torch.from_numpy(r) for r in results)
        ctx.mark_non_differentiable(tensors[4])
        return tensors

    @staticmethod
    @once_differentiable
    # type: ignore (torch's own takes any number of gradients)
    def backward(
        ctx: Any, g_means2d: Tensor, g_conics: Tensor, g_alphas: Tensor, g_depths: Tensor, _: Tensor
    ) -> tuple[Tensor | None, ...]:
        """Gradients of means, quats, scales, opacities and the cameras' poses."""
        gradients = torch.cat(
            [g_means2d, g_conics, g_alphas[..., None], g_depths[..., None]], -1
        )  # (C, N, 7)
        arrays, width, height, antialiased, alphas = ctx.problem
        outs, poses = project_backward(
            *arrays,
            width=width,
            height=height,
            antialiased=antialiased,
            alphas=alphas,
            gradients=_array(gradients),
        )
        means, quats, scales, opacities = torch.from_numpy(outs).split([3, 4, 3, 1], -1)
        cameras = torch.nn.functional.pad(torch.from_numpy(poses), (4, 0))  # (C, 16)
        return means, quats, scales, opacities[:, 0], cameras, None, None, None


class Draw(torch.autograd.Function):
    """Autograd function that composites the splats of C cameras."""

    @staticmethod
    def forward(
        ctx: Any,
        means2d: Tensor,
        conics: Tensor,
        alphas: Tensor,
        colors: Tensor,
        tiles: Sequence[Tiles],
        absolute: Tensor | None,
    ) -> tuple[Tensor, Tensor]:
        """Draws the splats of every camera.

        Args:
            ctx: Autograd's context.
            means2d: (C, N, 2) pixels.
            conics: (C, N, 3) entries xx, xy, yy of the inverse 2D covariances.
            alphas: (C, N) opacities after the low-pass filter.
            colors: (C, N, 3).
            tiles: One `Tiles` for each camera.
            absolute: (C, N, 2) buffer to which `backward` writes the gradients of means2d, summed
                over pixels as absolute values; None where they are not wanted.

        Returns:
            Images (C, H, W, 3) on black and transmittances (C, H, W).
        """
        splats = zip(*(map(_array, (means2d, conics, alphas, colors))), strict=True)
        records = [splat_records(*parts) for parts in splats]
        drawn = [draw(r, t) for r, t in zip(records, tiles, strict=True)]
        ctx.problem, ctx.absolute = (records, tiles, drawn), absolute
        images, lights = zip(*drawn, strict=True)
        return _stacked(images), _stacked(lights)

    @staticmethod
    @once_differentiable
    # type: ignore (torch's own takes any number of gradients)
    def backward(ctx: Any, g_images: Tensor, g_lights: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of means2d, conics, alphas and colors."""
        wanted = ctx.absolute is not None
        views = zip(*ctx.problem, _array(g_images), _array(g_lights), strict=True)
        gradients = _stacked(
            [
                draw_backward(records, tiles, image, light, g_image, g_light, wanted)
                for records, tiles, (image, light), g_image, g_light in views
            ]
        )  # (C, N, 9 or 11)
        means2d, conics, alphas, colors = gradients[..., :9].split([2, 3, 1, 3], -1)
        if wanted:
            ctx.absolute += gradients[..., 9:]
        return means2d, conics, alphas[..., 0], colors, None, None


class Over(torch.autograd.Function):
    """Autograd function that puts a picture on black over a background."""

    @staticmethod
    def forward(ctx: Any, image: Tensor, alpha: Tensor, behind: Tensor) -> Tensor:
        """Returns (C, H, W, 3) for images (C, H, W, 3), alphas (C, H, W) and (C, H, W, 3)."""
        out = torch.empty_like(image, memory_format=torch.contiguous_format)
        arrays = (_array(image), _array(alpha), _array(behind))
        put_over(*(array.reshape(-1) for array in (*arrays, out.numpy())))
        ctx.arrays = arrays[1:]
        return out

    @staticmethod
    @once_differentiable
    # type: ignore (torch's own takes any number of gradients)
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of images, alphas and, where it is wanted, the background."""
        alpha, behind = ctx.arrays
        by_alpha = torch.empty(alpha.shape)
        parts = (behind, _array(gradient), by_alpha.numpy())
        put_over_backward(*(array.reshape(-1) for array in parts))
        if not ctx.needs_input_grad[2]:
            return gradient, by_alpha, None
        return gradient, by_alpha, gradient * torch.from_numpy(1 - alpha)[..., None]


def bin_views(
    means2d: Tensor,
    conics: Tensor,
    alphas: Tensor,
    depths: Tensor,
    extents: Tensor,
    width: int,
    height: int,
) -> list[Tiles]:
    """Sorts splats into tiles: one `Tiles` per camera; the arguments are what `Project` returns."""
    views = zip(*map(_array, (means2d, conics, alphas, depths, extents)), strict=True)
    return [bin_splats(*view, width=width, height=height) for view in views]
