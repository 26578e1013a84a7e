"""Rendering somebody who moves along a path of cameras."""

from collections.abc import Iterator, Sequence

import numpy as np
import torch

from ico3d.avatar.moving import Moving, back_and_forth
from ico3d.common.camera import Camera
from ico3d.splat.device import CPU
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render


@torch.no_grad()
def pictures(
    person: Moving,
    cameras: Sequence[Camera],
    fps: float,
    background: Sequence[float],
    backdrop: Gaussians | None = None,
    device: torch.device = CPU,
) -> Iterator[np.ndarray]:
    """What the cameras see one after the other while time runs, back and forth through the clip.

    Args:
        person: Who moves.
        cameras: One per picture.
        fps: Pictures per second.
        background: (3,) colour in [0, 1].
        backdrop: What stands behind the person, in the world.
        device: Where they are drawn.

    Yields:
        (H, W, 3) uint8.
    """
    behind = torch.tensor(background)
    around = [] if backdrop is None else [backdrop.to(device)]
    for number, camera in enumerate(cameras):
        shown = person.gaussians(back_and_forth(number / fps, person.seconds)).to(device)
        rgb = render(cat([shown, *around]), [camera], behind).rgb[0].clamp(0, 1)  # (H, W, 3)
        yield (rgb * 255 + 0.5).to(torch.uint8).cpu().numpy()
