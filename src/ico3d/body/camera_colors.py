"""How the colours of the recording cameras differ: an affine map of colours for each camera.

Only differences between cameras can be learnt: if all maps were changed alike, the Gaussians could
change the other way and every picture would stay the same. So the mean of the maps is held at the
identity. Gaussians then have the colours of an average camera, in each window alike, and cameras
that trained nothing are drawn without a map.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ico3d.splat.rendering import Rendering


def identities(cameras: int, device: torch.device) -> Tensor:
    """(C, 3, 4) maps that change nothing: a matrix (3, 3) beside an offset (3,) for each camera."""
    return torch.eye(3, 4, device=device).repeat(cameras, 1, 1)  # (C, 3, 4)


def seen_by(rendering: Rendering, camera: Tensor, behind: Tensor) -> Rendering:
    """A rendering with the colours that a camera gives to what is drawn.

    The map is applied to the picture and not to the Gaussians: blending is linear, so both are the
    same, and pictures are so corrected whatever the colours of Gaussians depend on.

    Args:
        rendering: Pictures over any background.
        camera: (3, 4) the camera's map.
        behind: (3,) background, which the map leaves alone.
    """
    alpha = rendering.alpha[..., None]  # (1, H, W, 1)
    drawn = rendering.drawing.rgb @ camera[:, :3].T + alpha * camera[:, 3]  # (1, H, W, 3)
    return replace(rendering, rgb=drawn + (1 - alpha) * behind)


@torch.no_grad()
def center(maps: Tensor, cameras: Sequence[int]) -> None:
    """Makes the mean over some cameras the identity, in place; maps of other cameras stay.

    Args:
        maps: (C, 3, 4).
        cameras: Indices of the cameras that learn.
    """
    excess = maps[cameras].mean(0) - identities(1, maps.device)[0]  # (3, 4)
    maps[cameras] -= excess
