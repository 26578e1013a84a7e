"""What baking costs: exact and baked head beside the recorded pictures."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.bundle.head import BakedHead
from ico3d.bundle.manifest import Loss
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import PictureCache, View, staged
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

MAX_DROP = 0.3
"""dB that the baked head may lose against ground truth."""
MIN_LIKENESS = 45.0
"""dB of the baked against the exact picture, at least."""
_CPU = torch.device("cpu")


@dataclass(frozen=True)
class Reference:
    """One picture of the exact model, and what was recorded; pictures (H, W, 3) float16.

    Attributes:
        camera: The camera in canonical head space.
        expression: (B,) float32.
        background: (3,) or (H, W, 3), on the device that draws.
        exact: What the exact model shows.
        truth: What was recorded, None where nothing was.
    """

    camera: Camera
    expression: np.ndarray
    background: torch.Tensor
    exact: np.ndarray
    truth: np.ndarray | None = None


def references(
    head: TrainedHead, capture: Capture, neutral: tuple[float, float, float], count: int
) -> list[Reference]:
    """Views of test frames, evenly spread, with what the exact model makes of them.

    Args:
        head: The exact head.
        capture: Where the pictures come from.
        neutral: Background where the capture has none.
        count: How many views at most.

    Raises:
        CaptureError: If no test frame has a picture.
    """
    pictures, track = PictureCache(capture, 0.0), head.track(capture)
    frames = capture.split.test
    chosen = [frames[i] for i in spread(len(frames), count)]
    views = pictures.views(chosen)[: 4 * count]
    if not views:
        raise CaptureError(f"{capture.path}: no test frame has a picture to measure baking with.")
    with torch.no_grad():
        return [
            _reference(head, pictures, view, track.at(view.frame), neutral)
            for view in (views[i] for i in spread(len(views), count))
        ]


def measure(head: BakedHead, views: list[Reference]) -> Loss:
    """Mean PSNR over views, whole pictures."""
    baked = [baked_picture(head, view) for view in views]
    pairs = list(zip(baked, views, strict=True))
    return Loss(
        psnr_exact=mean_of(psnr(v.exact, v.truth) for v in views if v.truth is not None),
        psnr_baked=mean_of(psnr(b, v.truth) for b, v in pairs if v.truth is not None),
        psnr_baked_vs_exact=mean_of(psnr(b, v.exact) for b, v in pairs),
    )


def drop(loss: Loss) -> float | None:
    """What is lost against ground truth, in dB; None where there is none."""
    exact, baked = loss.psnr_exact, loss.psnr_baked
    return None if exact is None or baked is None else exact - baked


def acceptable(loss: Loss) -> bool:
    """Whether a measured loss is within `MAX_DROP` and `MIN_LIKENESS`."""
    return (drop(loss) or 0.0) <= MAX_DROP and (loss.psnr_baked_vs_exact or 0.0) >= MIN_LIKENESS


def in_words(loss: Loss) -> str:
    """A loss as a phrase for people."""
    against, lost = "", drop(loss)
    if lost is not None:
        against = (
            f"{loss.psnr_exact:.2f} dB exact, {loss.psnr_baked:.2f} dB baked ({lost:+.3f} dB "
            "lost), "
        )
    return f"{against}{loss.psnr_baked_vs_exact:.2f} dB baked against exact"


def strip(head: BakedHead, views: list[Reference], rows: int = 4) -> np.ndarray:
    """[Truth |] exact | baked of some views, one below the other: (rows·H, 3·W or 2·W, 3) uint8."""
    chosen = [views[i] for i in spread(len(views), rows)]
    lines = []
    for view in chosen:
        pictures = [view.exact, baked_picture(head, view)]
        lines.append(np.hstack(pictures if view.truth is None else [view.truth, *pictures]))
    return (np.vstack(lines).astype(np.float32).clip(0, 1) * 255 + 0.5).astype(np.uint8)


def baked_picture(head: BakedHead, view: Reference) -> np.ndarray:
    """The baked head where the reference is: (H, W, 3) float32."""
    return _picture(baked_gaussians(head, view.expression), view.camera, view.background)


def _reference(
    head: TrainedHead,
    pictures: PictureCache,
    view: View,
    expression: torch.Tensor,
    neutral: tuple[float, float, float],
) -> Reference:
    """Without a clean background, the person is cut out over the neutral colour."""
    picture = pictures.picture(view, _CPU)
    plate = pictures.background(view, _CPU)
    behind, truth = staged(picture, plate, torch.tensor(neutral))
    return reference(head, view.camera, expression, behind, truth.numpy().astype(np.float16))


def reference(
    head: TrainedHead,
    camera: Camera,
    expression: torch.Tensor,
    background: torch.Tensor,
    truth: np.ndarray | None = None,
) -> Reference:
    """What the exact head shows to a camera in canonical head space, drawn where it is."""
    background = background.to(head.model.device)
    with torch.no_grad():
        exact = _picture(head.model(expression), camera, background).astype(np.float16)
    return Reference(camera, expression.numpy(), background, exact, truth)


def _picture(gaussians: Gaussians, camera: Camera, background: torch.Tensor) -> np.ndarray:
    with torch.no_grad():
        drawn = render(gaussians.to(background.device), [camera], background)
    return drawn.rgb[0].cpu().numpy()  # (H, W, 3)


def mean_of(values: Iterable[float | None]) -> float | None:
    """The mean of the values that are there; None where there is none."""
    found = [value for value in values if value is not None]
    return round(float(np.mean(found)), 4) if found else None
