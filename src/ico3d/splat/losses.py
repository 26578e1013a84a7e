"""Image losses: L1 and SSIM (paper eq. 2 and 5, in which SSIM enters as 1 − SSIM)."""

# pyright: reportIncompatibleMethodOverride=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
# (torch leaves some of its functions untyped)

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ico3d.common.psnr import decibels
from ico3d.splat.convention import SSIM_C1, SSIM_C2, SSIM_RADIUS, ssim_window


def l1(rgb: Tensor, target: Tensor) -> Tensor:
    """Mean absolute difference of two images of one shape."""
    return (rgb - target).abs().mean()


def ssim(rgb: Tensor, target: Tensor) -> Tensor:
    """Mean structural similarity, differentiable in `rgb` only.

    The window is an 11×11 Gaussian with σ = 1.5 pixels. Outside of the picture both images count as
    0, as is usual in 3DGS. For evaluation by other definitions see `ico3d.measure.scores`.

    Args:
        rgb: (..., H, W, 3) in [0, 1].
        target: Shaped as `rgb`.

    Returns:
        A scalar, 1 for equal images.

    Raises:
        ValueError: If the shapes differ or the last dimension is not 3.
    """
    return 1 - photometric(rgb, target, l1_weight=0, ssim_weight=1)


def photometric(
    rgb: Tensor,
    target: Tensor,
    *,
    l1_weight: float = 0.8,
    ssim_weight: float = 0.2,
    squares_weight: float = 0.0,
) -> Tensor:
    """λ_1·L1 + λ_s·(1 − SSIM) + λ_2·(mean squared difference), differentiable in `rgb` only.

    Args:
        rgb: (..., H, W, 3) in [0, 1].
        target: Shaped as `rgb`.
        l1_weight: λ_1.
        ssim_weight: λ_s; SSIM as `ssim` defines it.
        squares_weight: λ_2.

    Returns:
        A scalar.

    Raises:
        ValueError: If the shapes differ or the last dimension is not 3.
    """
    if rgb.shape != target.shape or rgb.shape[-1] != 3:
        raise ValueError(f"comparing pictures of {tuple(rgb.shape)} and {tuple(target.shape)}")
    images = rgb.reshape(-1, *rgb.shape[-3:])  # (C, H, W, 3)
    targets = target.detach().reshape(-1, *target.shape[-3:])
    weights = ssim_weight, l1_weight, squares_weight
    if rgb.is_cuda:
        return _photometric_by_torch(images, targets, *weights)
    return _CpuPhotometric.apply(images.float(), targets.float(), *weights)


def tensor_psnr(rgb: Tensor, target: Tensor, weight: Tensor | None = None) -> float:
    """PSNR in dB of tensors on their own device, for progress bars; reports use `psnr`.

    Args:
        rgb: (H, W, 3) in [0, 1].
        target: (H, W, 3) in [0, 1].
        weight: (H, W) weight of each pixel in [0, 1]; all pixels count fully by default.
    """
    if weight is None:
        return decibels(float(torch.nn.functional.mse_loss(rgb.detach(), target)))
    squares = (rgb.detach() - target).square()  # (H, W, 3)
    squares = squares.mean(-1)  # (H, W)
    return decibels(float((squares * weight).sum() / weight.sum().clamp_min(1)))


class _CpuPhotometric(torch.autograd.Function):
    """The fused kernel; the gradient is made along with the value."""

    @staticmethod
    def forward(
        ctx: Any, images: Tensor, targets: Tensor, ssim: float, l1: float, squares: float
    ) -> Tensor:
        from ico3d.splat.cpu.ssim import photometric_with_gradient

        pairs = zip(images.detach().contiguous(), targets.contiguous(), strict=True)
        values, gradients = zip(
            *(photometric_with_gradient(x.numpy(), y.numpy(), ssim, l1, squares) for x, y in pairs),
            strict=True,
        )
        stacked = [torch.from_numpy(gradient)[None] for gradient in gradients]
        few = stacked[0] if len(values) == 1 else torch.cat(stacked) / len(values)
        ctx.gradient = few  # (C, H, W, 3)
        return images.new_tensor(sum(values) / len(values))

    @staticmethod
    @once_differentiable
    # type: ignore (torch's own takes any number of gradients)
    def backward(ctx: Any, g_value: Tensor) -> tuple[Tensor, None, None, None, None]:
        whole = float(g_value) == 1
        return ctx.gradient if whole else ctx.gradient * g_value, None, None, None, None


def _photometric_by_torch(
    images: Tensor, targets: Tensor, ssim: float, l1: float, squares: float
) -> Tensor:
    """What the fused kernel computes, on any device."""
    away = images - targets
    loss = ssim * (1 - _ssim_by_convolution(images, targets))
    return loss + l1 * away.abs().mean() + squares * away.square().mean()


def _blur(images: Tensor) -> Tensor:
    """Blurs (C, 3, H, W) with SSIM's window."""
    window = images.new_tensor(ssim_window()).expand(3, 1, 1, -1)  # (3, 1, 1, 11)
    across = torch.nn.functional.conv2d(images, window, padding=(0, SSIM_RADIUS), groups=3)
    return torch.nn.functional.conv2d(
        across, window.transpose(2, 3), padding=(SSIM_RADIUS, 0), groups=3
    )


def _ssim_by_convolution(images: Tensor, targets: Tensor) -> Tensor:
    """Mean SSIM of (C, H, W, 3) images on any device."""
    x, y = images.movedim(-1, 1), targets.movedim(-1, 1)  # (C, 3, H, W)
    mean_x, mean_y = _blur(x), _blur(y)
    var_x, var_y = _blur(x * x) - mean_x**2, _blur(y * y) - mean_y**2
    covariance = _blur(x * y) - mean_x * mean_y
    above = (2 * mean_x * mean_y + SSIM_C1) * (2 * covariance + SSIM_C2)
    below = (mean_x**2 + mean_y**2 + SSIM_C1) * (var_x + var_y + SSIM_C2)
    return (above / below).mean()
