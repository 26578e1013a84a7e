"""The results of `render`."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# (torch leaves some of its functions untyped)

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor


@dataclass
class RenderInfo:
    """Data of a rendering that density control needs.

    Attributes:
        radii: (C, N) int32 distance in pixels from a splat's centre to its farthest end; 0 if
            unseen.
        means2d: (C, N, 2) splat centres in pixels; the tensor holds its gradient after `backward`.
        width: Image width in pixels.
        height: Image height in pixels.
        absolute: Where asked for: a function that returns, after `backward`, the gradient (C, N, 2)
            of means2d summed over pixels as absolute values.
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
        """The data of the first `count` Gaussians, for renderings that contain further ones."""
        return replace(self, radii=self.radii[:, :count])

    def screen_gradients(self) -> Tensor:
        """(C, N) length of the gradient of the loss by the splat's centre on the screen.

        The unit is that of 3DGS: normalised device coordinates, in which the image is 2 wide and 2
        high. Where absolute gradients were asked for, pulls in opposite directions do not cancel
        out (AbsGS).

        Raises:
            RuntimeError: If `backward` has not run, or the means do not require gradients.
        """
        if self.means2d.grad is None:
            raise RuntimeError("screen gradients exist only after backward of a render")
        gradient = self.means2d.grad if self.absolute is None else self.absolute()  # (C, N, 2)
        count = self.radii.shape[1]
        x, y = gradient[:, :count].unbind(-1)  # (C, N) each
        return torch.hypot(x * (self.width / 2), y * (self.height / 2))  # (C, N)


@dataclass
class Drawing:
    """Pictures of Gaussians on black, as a backend returns them.

    Attributes:
        rgb: (C, H, W, 3).
        alpha: (C, H, W).
        draw_depth: Function that returns (C, H, W) depths in metres, weighted by the splats'
            contributions.
        info: Position and size of the splats, for density control.
    """

    rgb: Tensor
    alpha: Tensor
    draw_depth: Callable[[], Tensor]
    info: RenderInfo


@dataclass
class Rendering:
    """Images of C cameras.

    Attributes:
        rgb: (C, H, W, 3) picture over the background.
        alpha: (C, H, W) share of the background that is hidden.
        drawing: The picture on black, as the backend returned it.
    """

    rgb: Tensor
    alpha: Tensor
    drawing: Drawing

    @property
    def info(self) -> RenderInfo:
        """Position and size of the splats, and their gradients, for density control."""
        return self.drawing.info

    @cached_property
    def depth(self) -> Tensor:
        """(C, H, W) expected depth in metres along z; 0 where no Gaussian is.

        The depth is drawn at the first access, since few callers need it.
        """
        return self.drawing.draw_depth() / self.alpha.clamp_min(1e-10)
