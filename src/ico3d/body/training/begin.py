"""The state in which the training of a window begins: round Gaussians on points."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ico3d.body.companion import Companion
from ico3d.body.motion.window_model import HARMONICS, WindowModel
from ico3d.body.settings import BodySettings
from ico3d.body.training.surface_points import point_colors
from ico3d.capture.capture import Capture
from ico3d.splat.initial import spacing


@dataclass(frozen=True)
class Begin:
    """The state in which the training of a window begins.

    Attributes:
        model: The window's model.
        extent: Half the longest edge of the person's bounding box, metres.
        source: Where the first points come from, in words.
    """

    model: WindowModel
    extent: float
    source: str


def trespassing(companion: Companion, points: np.ndarray, frame: int) -> np.ndarray:
    """(P,) bool: which positions (P, 3) in the world the body may not fill at a frame."""
    return companion.trespassing(torch.from_numpy(points).float(), frame).cpu().numpy()


def round_gaussians(
    capture: Capture, frames: Sequence[int], clouds: list[np.ndarray], settings: BodySettings
) -> dict[str, Tensor]:
    """Tensors of `CANONICAL` for round Gaussians on points, coloured by recorded pictures.

    Args:
        capture: The recording.
        frames: The frame of each cloud, whose pictures give the colours.
        clouds: For each frame, (P, 3) positions in the world, metres.
        settings: Sizes, relative to the distance between points, and opacity.
    """
    colors = [point_colors(p, capture, f) for p, f in zip(clouds, frames, strict=True)]
    sizes = np.concatenate([spacing(cloud) for cloud in clouds]) * settings.initial.scale  # (P,)
    count, opacity = len(sizes), settings.initial.opacity
    color = torch.from_numpy(np.concatenate(colors).clip(0.02, 0.98)).float()  # (P, 3)
    rest = torch.zeros(count, (settings.sh_degree + 1) ** 2 - 1, 3)
    return {
        "means": torch.from_numpy(np.concatenate(clouds)).float(),
        "quats": torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
        "log_scales": torch.from_numpy(np.log(sizes)).float()[:, None].repeat(1, 3),
        "opacity_logits": torch.full((count,), math.log(opacity / (1 - opacity))),
        "color_logits": color.logit(),
        **({HARMONICS: rest} if settings.sh_degree else {}),
    }
