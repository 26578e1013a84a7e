"""Pictures of Gaussians for captures that are made in memory: each is drawn once."""

import hashlib

import numpy as np
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

_TAKEN: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}


def photograph(
    gaussians: Gaussians, camera: Camera, behind: Tensor | None
) -> tuple[np.ndarray, np.ndarray]:
    """Picture (H, W, 3) and alpha (H, W) of Gaussians; many tests ask for the same ones."""
    shown = (gaussians.means, gaussians.quats, gaussians.scales, gaussians.opacities)
    parts = [*shown, gaussians.colors, *([] if behind is None else [behind])]
    arrays = [part.detach().numpy() for part in parts]
    arrays += [camera.intrinsics, camera.world_to_camera, np.array([camera.width, camera.height])]
    key = hashlib.blake2b(b"".join(map(_exactly, arrays))).digest()
    if key not in _TAKEN:
        drawn = render(gaussians, [camera], behind)
        _TAKEN[key] = drawn.rgb[0].detach().numpy(), drawn.alpha[0].detach().numpy()
    picture, alpha = _TAKEN[key]
    return picture.copy(), alpha.copy()


def _exactly(array: np.ndarray) -> bytes:
    return f"{array.dtype}{array.shape}".encode() + array.tobytes()
