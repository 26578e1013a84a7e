"""What it costs that colours no longer depend on the view."""

from collections.abc import Sequence
from functools import partial

import numpy as np
import torch

from ico3d.avatar.baking import body_cost
from ico3d.avatar.baking.head_cost import Reference, mean_of
from ico3d.avatar.clip_views import recorded_views
from ico3d.body.model_folder import TrainedBody
from ico3d.bundle.manifest import Loss
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.psnr import psnr
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.render import render


def head_loss(flat: TrainedHead, views: Sequence[Reference]) -> Loss:
    """Mean PSNR of whole pictures.

    Args:
        flat: The head with colours of degree 0.
        views: Pictures of the exact head.
    """
    drawn = [_picture(flat, view) for view in views]
    pairs = list(zip(drawn, views, strict=True))
    return Loss(
        mean_of(psnr(view.exact, view.truth) for view in views if view.truth is not None),
        mean_of(psnr(ours, view.truth) for ours, view in pairs if view.truth is not None),
        mean_of(psnr(ours, view.exact) for ours, view in pairs),
    )


def body_loss(
    body: TrainedBody, flat: TrainedBody, capture: Capture | None, cameras: Sequence[Camera]
) -> Loss:
    """Mean PSNR on the person, over all windows.

    Args:
        body: The exact body.
        flat: The same with colours of degree 0.
        capture: The recording, to measure with; None measures against the exact body only.
        cameras: Cameras by which both bodies are compared.
    """
    losses = []
    for index, span in enumerate(body.windows):
        recorded = recorded_views(capture, span) if capture else []
        probes = body_cost.probe_views(cameras, span)
        exact, ours = (partial(one.window_gaussians, index) for one in (body, flat))
        losses.append(body_cost.measure(exact, ours, recorded, probes))
    return Loss(
        mean_of(loss.psnr_exact for loss in losses),
        mean_of(loss.psnr_baked for loss in losses),
        mean_of(loss.psnr_baked_vs_exact for loss in losses),
    )


@torch.no_grad()
def _picture(flat: TrainedHead, view: Reference) -> np.ndarray:
    """(H, W, 3) the head as the camera of a reference sees it."""
    gaussians = flat.model(torch.from_numpy(np.asarray(view.expression, np.float32)))
    return render(gaussians, [view.camera], view.background).rgb[0].cpu().numpy()
