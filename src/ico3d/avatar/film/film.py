"""Renders the pictures of a film: a moving person seen along a path of cameras."""

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
    """Renders a moving person picture by picture; the clip is played back and forth.

    Args:
        person: Who moves.
        cameras: The camera of each picture.
        fps: Pictures per second.
        background: RGB in [0, 1].
        backdrop: Splats behind the person, in the world; None for none.
        device: Where pictures are drawn.

    Yields:
        (H, W, 3) uint8 RGB pictures.
    """
    behind = torch.tensor(background)
    around = [] if backdrop is None else [backdrop.to(device)]
    for number, camera in enumerate(cameras):
        shown = person.gaussians(back_and_forth(number / fps, person.seconds)).to(device)
        rgb = render(cat([shown, *around]), [camera], behind).rgb[0].clamp(0, 1)  # (H, W, 3)
        yield (rgb * 255 + 0.5).to(torch.uint8).cpu().numpy()
