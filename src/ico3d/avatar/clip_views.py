"""Recorded pictures of a clip, and what is drawn of somebody beside them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar.moving import Span
from ico3d.avatar.staging import NEUTRAL
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

VIEWS = 24
"""Pictures of a window that are looked at."""
At = Callable[[float], Gaussians]
"""Somebody in the world at τ in [0, 1] of a span of time."""


@dataclass(frozen=True)
class View:
    """A camera at a time of a window; picture and mask where they were recorded.

    Attributes:
        camera: The camera in the world.
        tau: Moment of the window, 0 to 1.
        background: (3,) or (H, W, 3) what stands behind the person.
        truth: (H, W, 3), or None.
        mask: (H, W) the person, or None.
    """

    camera: Camera
    tau: float
    background: torch.Tensor
    truth: np.ndarray | None = None
    mask: np.ndarray | None = None


def recorded_views(capture: Capture, span: Span, count: int = VIEWS) -> Iterator[View]:
    """Pictures of the test cameras, or of all where none tests, spread over a window.

    One at a time: large recordings do not fit into memory. Where the capture lacks a clean
    background, the person is cut out over a neutral colour.
    """
    frames, cameras = range(span.first, span.last + 1), measuring_cameras(capture)
    pairs = [(camera, frame) for frame in frames for camera in cameras]
    for number in spread(len(pairs), count):
        view = recorded_view(capture, *pairs[number], span=span)
        if view is not None:
            yield view


def measuring_cameras(capture: Capture) -> tuple[int, ...]:
    """The test cameras, or all where none tests."""
    return capture.split.test_cameras or tuple(range(len(capture.cameras)))


def recorded_view(capture: Capture, camera: int, frame: int, span: Span) -> View | None:
    """One recorded picture; None where there is none, or nobody in it."""
    truth, mask = capture.image(camera, frame), capture.mask(camera, frame)
    if truth is None or (mask is not None and not mask.any()):
        return None
    behind = capture.background(camera)
    if behind is None:
        behind = np.array(NEUTRAL, np.float32)
        if mask is not None:
            truth = truth * mask[..., None] + behind * (1 - mask[..., None])
    tau = (frame - span.first) / (span.last - span.first)
    return View(capture.cameras[camera], tau, torch.from_numpy(behind), truth, mask)


def drawn(person: At, view: View) -> tuple[np.ndarray, np.ndarray]:
    """What a view shows of somebody: (H, W, 3) and alpha (H, W)."""
    with torch.no_grad():
        rendered = render(person(view.tau), [view.camera], view.background)
    return rendered.rgb[0].cpu().numpy(), rendered.alpha[0].cpu().numpy()
