"""A capture of one frame with pictures that virtual cameras take of a head of Gaussians."""

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
"""Value of R, G and B in the grey behind the head."""


class DrawnHead(Capture):
    """A head of Gaussians as a capture: each picture is drawn when it is asked for."""

    kind = "drawn head"
    path = Path("drawn")
    fps = 1.0
    num_frames = 1
    split = Split((0,), ())

    def __init__(self, gaussians: Gaussians, cameras: Sequence[Camera]):
        """Places cameras around a head.

        Args:
            gaussians: The head in the world of the cameras.
            cameras: Cameras that look at the head, each with pictures of any size.
        """
        self.gaussians, self.cameras = gaussians, tuple(cameras)

    def drawn(self, camera: int) -> Rendering:
        """The rendering of camera number `camera`: a batch of one picture, with alpha and depth."""
        wall = self.gaussians.means.new_full((3,), BEHIND)
        with torch.no_grad():
            return render(self.gaussians, [self.cameras[camera]], wall)

    def image(self, camera: int, frame: int) -> np.ndarray:
        """The picture (H, W, 3) float32 RGB of a camera; `frame` is 0, the only one."""
        return self.drawn(camera).rgb[0].clamp(0, 1).cpu().numpy()
