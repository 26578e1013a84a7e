"""Recorded pictures of a clip, and a model's rendering from the same camera and time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar.moving import Span, tau_in
from ico3d.avatar.staging import NEUTRAL
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

VIEWS = 24
"""Default number of pictures of a window that are compared."""
At = Callable[[float], Gaussians]
"""Returns a person's Gaussians in the world at τ in [0, 1] of a window or clip."""


@dataclass(frozen=True)
class View:
    """A camera at a time of a window, with what it recorded there, if it did.

    Attributes:
        camera: The camera in the world.
        tau: Time in the window, 0 at its first frame and 1 at its last.
        background: (3,) or (H, W, 3) colour behind the person.
        truth: (H, W, 3) recorded picture; None where nothing was recorded.
        mask: (H, W) mask of the person; None where there is none.
    """

    camera: Camera
    tau: float
    background: torch.Tensor
    truth: np.ndarray | None = None
    mask: np.ndarray | None = None


def recorded_views(capture: Capture, span: Span, count: int = VIEWS) -> Iterator[View]:
    """Recorded pictures, spread evenly over the cameras that measure and the frames of a window.

    They are read one at a time, as large recordings do not fit into memory. Where the capture
    lacks a clean background, the person is cut out over a neutral colour.

    Args:
        capture: The recording.
        span: The window.
        count: Number of pictures at most.
    """
    frames, cameras = range(span.first, span.last + 1), measuring_cameras(capture)
    pairs = [(camera, frame) for frame in frames for camera in cameras]
    for number in spread(len(pairs), count):
        view = recorded_view(capture, *pairs[number], span=span)
        if view is not None:
            yield view


def measuring_cameras(capture: Capture) -> tuple[int, ...]:
    """Indices of the cameras that measure: the test cameras, or all where there are none."""
    return capture.split.test_cameras or tuple(range(len(capture.cameras)))


def recorded_view(capture: Capture, camera: int, frame: int, span: Span) -> View | None:
    """One recorded picture; None where there is no picture, or the mask shows nobody in it.

    Args:
        capture: The recording; without a clean background, the masked person is put over a neutral
            colour.
        camera: Index of the camera.
        frame: Index of the frame.
        span: The window in which the view's τ is told.
    """
    truth, mask = capture.image(camera, frame), capture.mask(camera, frame)
    if truth is None or (mask is not None and not mask.any()):
        return None
    behind = capture.background(camera)
    if behind is None:
        behind = np.array(NEUTRAL, np.float32)
        if mask is not None:
            truth = truth * mask[..., None] + behind * (1 - mask[..., None])
    behind = torch.from_numpy(behind)
    return View(capture.cameras[camera], tau_in(span, frame), behind, truth, mask)


def drawn(person: At, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Renders a person for a view: RGB (H, W, 3) and alpha (H, W), float32."""
    with torch.no_grad():
        rendered = render(person(view.tau), [view.camera], view.background)
    return rendered.rgb[0].cpu().numpy(), rendered.alpha[0].cpu().numpy()
