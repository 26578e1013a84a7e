"""The CUDA backend of `splat.render`, by gsplat."""

# pyright: reportMissingImports=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownParameterType=false, reportUnknownLambdaType=false
# (gsplat is untyped, and not installed everywhere)

import re
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.errors import MissingExtraError, SettingsError
from ico3d.splat.convention import BLUR, GSPLAT, NEAR
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.rendering import Drawing, RenderInfo


def _rasterization():
    """Gsplat's entry point, imported at first need: gsplat may compile its kernels then.

    Raises:
        MissingExtraError: If gsplat is not installed.
        SettingsError: If it is of a version that draws otherwise.
    """
    try:
        import gsplat
    except ImportError as error:
        raise MissingExtraError("gsplat", "cuda", "rendering on a CUDA device") from error
    version = str(gsplat.__version__)
    numbers = tuple(map(int, re.findall(r"\d+", version)[:3]))
    oldest, newest = GSPLAT
    if not oldest <= numbers < newest:
        bounds = (".".join(map(str, bound)) for bound in GSPLAT)
        raise SettingsError(
            "gsplat {} is installed, which draws otherwise than ico3d's CPU rasteriser: it takes "
            "{} or newer and older than {}; pip install 'ico3d[cuda]' installs one.".format(
                version, *bounds
            )
        )
    return gsplat.rasterization


def _not_compiled() -> SettingsError:
    """What to say where gsplat lacks the kernels that it compiles at first use."""
    return SettingsError(
        "gsplat is installed without its compiled part: it needs CUDA's compiler nvcc, of the "
        f"version that torch was built with ({torch.version.cuda})."
    )


def _empty(colors: Tensor, cameras: Sequence[Camera]) -> Drawing:
    """A drawing of nothing, which gsplat's kernels do not make."""
    count, splats = colors.shape[:2]
    width, height = cameras[0].width, cameras[0].height
    rgb = colors.new_zeros(count, height, width, 3)
    radii = torch.zeros(count, splats, dtype=torch.int32, device=colors.device)
    info = RenderInfo(radii, colors.new_zeros(count, splats, 2), width, height)
    return Drawing(rgb, rgb[..., 0], lambda: rgb[..., 0], info)


def draw_gaussians(
    gaussians: Gaussians,
    colors: Tensor,
    cameras: Sequence[Camera],
    poses: Tensor,
    antialiased: bool,
    absgrad: bool,
) -> Drawing:
    """Draws Gaussians on black, on a CUDA device.

    Args:
        gaussians: Float32, on a CUDA device.
        colors: (C, N, 3) colours of the Gaussians as each camera sees them.
        cameras: C cameras with one picture size; only size and intrinsics are used, not their
            poses.
        poses: (C, 4, 4) float64, world to camera.
        antialiased: Whether a splat's opacity is reduced where the low-pass filter enlarges it.
        absgrad: Whether screen-space gradients are also summed over pixels as absolute values.

    Returns:
        The drawing.

    Raises:
        MissingExtraError: If gsplat is not installed.
        SettingsError: If gsplat is installed but cannot be used.
    """
    width, height = cameras[0].width, cameras[0].height
    if len(gaussians) == 0 or width * height == 0:
        return _empty(colors, cameras)
    rasterization = _rasterization()
    intrinsics = np.stack([camera.intrinsics for camera in cameras])  # (C, 3, 3)

    def rasterise(mode: str) -> tuple[Tensor, Tensor, dict[str, Any]]:
        return rasterization(
            gaussians.means,
            gaussians.quats,
            gaussians.scales,
            gaussians.opacities,
            colors,
            poses.to(gaussians.means),
            torch.from_numpy(intrinsics).to(gaussians.means),
            width,
            height,
            near_plane=NEAR,
            eps2d=BLUR,
            packed=False,
            render_mode=mode,
            rasterize_mode="antialiased" if antialiased else "classic",
            absgrad=absgrad,
        )

    try:
        rgb, alpha, meta = rasterise("RGB")  # (C, H, W, 3), (C, H, W, 1)
    except (AttributeError, ImportError) as error:
        if getattr(sys.modules.get("gsplat.cuda._backend"), "_C", None) is None:
            raise _not_compiled() from error
        raise
    if meta["means2d"].requires_grad:
        meta["means2d"].retain_grad()
    radii = meta["radii"]  # (C, N, 2) or, in older versions, (C, N)
    radii = (radii.amax(-1) if radii.dim() == 3 else radii).int()  # (C, N)
    absolute = (lambda: meta["means2d"].absgrad) if absgrad else None
    info = RenderInfo(radii, meta["means2d"], width, height, absolute)
    return Drawing(rgb, alpha[..., 0], lambda: rasterise("D")[0][..., 0], info)


def put_over(drawing: Drawing, behind: Tensor) -> Tensor:
    """The pictures (C, H, W, 3) over a background (3,), (H, W, 3) or (C, H, W, 3)."""
    return drawing.rgb + (1 - drawing.alpha)[..., None] * behind
