"""The paper's table of frame rates: background, body, head and all, of random models."""

import numpy as np
import torch

from full_size.models import SPEECH, backdrop, random_body, random_head
from ico3d.protocols.viewer import Part, Staged
from ico3d.splat.gaussians import Gaussians

SECONDS = 1.0
"""Length of the clip, and the time in which a body goes once through its window."""
NECK = (0.0, 0.85, 0.0)
"""Where the head stands above the middle of the body, metres."""


def random_person(behind: int, of_body: int, of_head: int, device: torch.device) -> Staged:
    """A person before a background, through the networks of the paper's settings.

    Args:
        behind: Number of Gaussians of the background.
        of_body: Number of Gaussians of the body.
        of_head: Number of Gaussians of the head.
        device: Where they are computed and drawn.
    """
    wall, body = backdrop(behind, device), random_body(of_body, device)
    head, neck = random_head(of_head, device), np.eye(4)
    neck[:3, 3] = NECK
    random = torch.Generator().manual_seed(0)

    def speaking(_: float) -> Gaussians:
        expression = torch.rand(SPEECH, generator=random).to(device)  # a new one, as in speech
        return head(expression).transform(neck)

    def moving(seconds: float) -> Gaussians:
        return body.at(seconds / SECONDS)

    def still(_: float) -> Gaussians:
        return wall

    parts: dict[str, Part] = {"background": still, "body": moving, "head": speaking}
    return Staged(parts, SECONDS, device)
