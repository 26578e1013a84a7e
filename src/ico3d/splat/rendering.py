"""What a render gives."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# (torch leaves some of its functions untyped)

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor


@dataclass
class RenderInfo:
    """What density control needs of a render.

    Attributes:
        radii: (C, N) int32 pixels from a splat's centre to its farthest end; 0 where unseen.
        means2d: (C, N, 2) pixels; holds its gradient after `backward`.
        width: Image width in pixels.
        height: Image height in pixels.
        absolute: Gives (C, N, 2) after `backward`: the gradient of means2d summed over pixels
            without signs, where that was asked for.
    """

    radii: Tensor
    means2d: Tensor
    width: int
    height: int
    absolute: Callable[[], Tensor] | None = None

    @property
    def visible(self) -> Tensor:
        """(C, N) bool: whether the camera sees the Gaussian at all."""
        return self.radii > 0

    def first(self, count: int) -> "RenderInfo":
        """What is known of the first Gaussians of the render, where others came after them."""
        return replace(self, radii=self.radii[:, :count])

    def screen_gradients(self) -> Tensor:
        """(C, N) length of the loss's gradient by the splat's centre.

        Normalised as 3DGS does it: by device coordinates, in which the image is 2 wide and high.
        With absolute gradients, what pulls a splat to all sides at once does not cancel out
        (AbsGS).

        Raises:
            RuntimeError: If `backward` has not run, or the means need no gradient.
        """
        if self.means2d.grad is None:
            raise RuntimeError("screen gradients exist only after backward of a render")
        half = torch.tensor([self.width / 2, self.height / 2]).to(self.means2d)  # (2,)
        gradient = self.means2d.grad if self.absolute is None else self.absolute()  # (C, N, 2)
        count = self.radii.shape[1]
        return (gradient[:, :count] * half).norm(dim=-1)  # (C, N)


@dataclass
class Drawing:
    """Gaussians on black.

    Attributes:
        rgb: (C, H, W, 3).
        alpha: (C, H, W).
        draw_depth: Gives (C, H, W), depth weighted by what each splat contributes.
        info: Where and how large the splats are, for density control.
    """

    rgb: Tensor
    alpha: Tensor
    draw_depth: Callable[[], Tensor]
    info: RenderInfo


@dataclass
class Rendering:
    """Images of C cameras.

    Attributes:
        rgb: (C, H, W, 3), over the background.
        alpha: (C, H, W): how much of the background is hidden.
        drawing: The picture on black, and what was needed for it.
    """

    rgb: Tensor
    alpha: Tensor
    drawing: Drawing

    @property
    def info(self) -> RenderInfo:
        """Where and how large the splats are, with their gradients: density control needs both."""
        return self.drawing.info

    @cached_property
    def depth(self) -> Tensor:
        """(C, H, W) expected depth in metres along z, 0 where nothing is.

        Drawn when first asked for: few who render need it.
        """
        return self.drawing.draw_depth() / self.alpha.clamp_min(1e-10)
