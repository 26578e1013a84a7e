"""Head pose and expression in every frame of a body's capture."""

import logging

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError
from ico3d.head.model_folder import TrainedHead

log = logging.getLogger(__name__)

RIGID = 1e-3
"""Largest entry by which a rotation times its transpose may differ from the identity."""


def head_poses(capture: Capture) -> np.ndarray:
    """(F, 4, 4) float64 rigid head poses W_i of all frames.

    Raises:
        CaptureError: If a frame has no head pose, or one that is not rigid.
    """
    poses = [capture.world_from_head(frame) for frame in range(capture.num_frames)]
    lacking = [i for i, p in enumerate(poses) if p is None or not np.isfinite(p).all()]
    if lacking:
        raise CaptureError(
            f"{capture.path}: frame {lacking[0]} has no head pose ({len(lacking)} have none): "
            "find them with ico3d capture track."
        )
    stacked = np.stack([pose for pose in poses if pose is not None]).astype(np.float64)
    turns = stacked[:, :3, :3]  # (F, 3, 3)
    askew = np.abs(turns @ turns.mT - np.eye(3)).max((1, 2)) > RIGID  # (F,)
    askew |= np.linalg.det(turns) < 0
    if askew.any():
        raise CaptureError(
            f"{capture.path}: the head pose of frame {int(askew.argmax())} stretches or mirrors: "
            "a head pose turns and moves; find them anew with ico3d capture track."
        )
    return stacked


def recorded_expressions(head: TrainedHead, capture: Capture, neutral: np.ndarray) -> np.ndarray:
    """(F, B) float32 expressions of the head in every frame of the body's recording.

    Args:
        head: The head to drive.
        capture: The recording of the whole person.
        neutral: (B,) expression that is used, with a warning, if the capture lacks what drives the
            head.
    """
    try:
        track = head.track(capture)
        with torch.no_grad():
            return np.stack([track.at(frame).numpy() for frame in range(capture.num_frames)])
    except CaptureError as error:
        log.warning("%s The head keeps a neutral face while the body is trained.", error)
        return np.repeat(neutral[None], capture.num_frames, 0).astype(np.float32)
