"""A head of Gaussians in a studio of virtual cameras, as a capture of one frame."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.splat.rendering import Rendering

BEHIND = 0.5
"""Grey of the studio's walls."""


class DrawnHead(Capture):
    """Pictures that are drawn when they are asked for."""

    kind = "drawn head"
    path = Path("drawn")
    fps = 1.0
    num_frames = 1
    split = Split((0,), ())

    def __init__(self, gaussians: Gaussians, cameras: Sequence[Camera]):
        """Puts a head before cameras.

        Args:
            gaussians: The head in the world of the cameras.
            cameras: Cameras that look at the head, each with pictures of any size.
        """
        self.gaussians, self.cameras = gaussians, tuple(cameras)

    def drawn(self, camera: int) -> Rendering:
        """The picture (1, H, W) of a camera with its depth."""
        wall = self.gaussians.means.new_full((3,), BEHIND)
        with torch.no_grad():
            return render(self.gaussians, [self.cameras[camera]], wall)

    def image(self, camera: int, frame: int) -> np.ndarray:
        """The picture (H, W, 3)."""
        return self.drawn(camera).rgb[0].clamp(0, 1).cpu().numpy()
