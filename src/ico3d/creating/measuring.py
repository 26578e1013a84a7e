"""Measures an avatar on pictures of its video that it never saw."""

from collections.abc import Callable

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.capture.parts.held_out import scored_pictures
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.creating.events import Measured
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import PictureCache, staged
from ico3d.measure.head import HeadRenderer
from ico3d.measure.part_metrics import psnr_mouth

MOST = 40
"""Number of pictures that are compared."""


def measured(head: TrainedHead, capture: Capture, reached: Callable[[float], None]) -> Measured:
    """Compares the head with the test pictures of its capture, as `ico3d evaluate` does.

    Args:
        head: The trained head.
        capture: Its recording.
        reached: Told which share of the pictures is done.

    Raises:
        CaptureError: If a picture cannot be read.
    """
    _, frames = scored_pictures(capture, "test")
    pictures, renderer = PictureCache(capture, 0), HeadRenderer(head, capture)
    views = pictures.views([frames[i] for i in spread(len(frames), MOST)])
    faces, mouths = [], []
    for number, view in enumerate(views, 1):
        picture = pictures.picture(view, torch.device("cpu"))
        behind, target = staged(picture, pictures.background(view, torch.device("cpu")))
        truth, drawn = target.numpy(), renderer.picture(view, behind)
        mask = capture.head_mask(view.camera_index, view.frame)
        landmarks = capture.landmarks(view.camera_index, view.frame)
        faces.append(None if mask is None else psnr(drawn, truth, mask))
        mouths.append(None if landmarks is None else psnr_mouth(drawn, truth, landmarks))
        reached(number / len(views))
    return Measured(_mean(faces), _mean(mouths), len(views))


def _mean(values: list[float | None]) -> float | None:
    """The mean of those that could be measured."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
