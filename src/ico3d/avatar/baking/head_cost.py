"""What baking costs a head: PSNR of exact and baked head, to recorded pictures and each other."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.bundle.head import BakedHead
from ico3d.bundle.manifest import Loss
from ico3d.capture.capture import Capture
from ico3d.capture.parts.held_out import PartOfCapture, scored_pictures
from ico3d.capture.parts.over_torso import HeadOverTorso
from ico3d.common.camera import Camera
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.head.model_folder import TrainedHead
from ico3d.head.portrait.shoulders import shoulders_of
from ico3d.head.views import PictureCache, View, staged
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

MAX_DROP = 0.3
"""Most dB that a baked head may lose against ground truth."""
MIN_LIKENESS = 45.0
"""Least PSNR in dB of baked to exact pictures."""
_CPU = torch.device("cpu")

Posed = Callable[[Gaussians], Gaussians]


def _as_they_are(gaussians: Gaussians) -> Gaussians:
    return gaussians


@dataclass(frozen=True)
class Reference:
    """A picture of the exact head, with the recorded one where there is one.

    Attributes:
        camera: The camera in canonical head space.
        expression: (B,) float32.
        background: (3,) or (H, W, 3) colour behind the head, on the device that draws.
        exact: (H, W, 3) float16 picture of the exact head.
        truth: (H, W, 3) float16 recorded picture; None where nothing was recorded.
        posed: Puts the shoulders of a portrait where they were.
    """

    camera: Camera
    expression: np.ndarray
    background: torch.Tensor
    exact: np.ndarray
    truth: np.ndarray | None = None
    posed: Posed = _as_they_are


def references(
    head: TrainedHead, capture: Capture, neutral: tuple[float, float, float], count: int
) -> list[Reference]:
    """Recorded test pictures, evenly spread, each with one of the exact head.

    Args:
        head: The exact head.
        capture: The head's recording.
        neutral: RGB background where the capture has no clean one.
        count: Number of pictures at most.

    Raises:
        CaptureError: If there is no test picture.
    """
    cameras, frames = scored_pictures(capture, "test")
    shown = PartOfCapture(capture, cameras, frames)
    pictures = PictureCache(HeadOverTorso(shown) if head.over_torso else shown, 0.0)
    track = head.track(capture)
    shoulders = shoulders_of(shown, head.model.shape.neck, pictures)
    chosen = [frames[i] for i in spread(len(frames), count)]
    views = pictures.views(chosen)[: 4 * count]
    if not views:
        raise CaptureError(f"{capture.path}: there is no test picture to measure baking with.")
    found = []
    for view in (views[i] for i in spread(len(views), count)):
        posed = partial(shoulders.posed, frame=view.frame) if shoulders else _as_they_are
        with torch.no_grad():
            expression = track.at(view.frame)
        found.append(_reference(head, pictures, view, expression, neutral, posed))
    return found


def measure(head: BakedHead, views: list[Reference]) -> Loss:
    """Mean PSNR over views, of whole pictures."""
    baked = [baked_picture(head, view) for view in views]
    pairs = list(zip(baked, views, strict=True))
    return Loss(
        psnr_exact=mean_of(psnr(v.exact, v.truth) for v in views if v.truth is not None),
        psnr_baked=mean_of(psnr(b, v.truth) for b, v in pairs if v.truth is not None),
        psnr_baked_vs_exact=mean_of(psnr(b, v.exact) for b, v in pairs),
    )


def drop(loss: Loss) -> float | None:
    """Loss of baking against ground truth in dB; None where there is no ground truth."""
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
    """A picture that compares exact and baked head, one row for each of some views.

    Returns:
        (rows·H, 3·W, 3) uint8: recorded | exact | baked; (rows·H, 2·W, 3) without recorded ones.
    """
    chosen = [views[i] for i in spread(len(views), rows)]
    lines = []
    for view in chosen:
        pictures = [view.exact, baked_picture(head, view)]
        lines.append(np.hstack(pictures if view.truth is None else [view.truth, *pictures]))
    return stacked(lines)


def stacked(lines: Sequence[np.ndarray]) -> np.ndarray:
    """Rows of pictures under one another; cameras may differ, so that rows have any size.

    Args:
        lines: (H_i, W_i, 3) display values.

    Returns:
        (ΣH, W, 3) uint8, W that of the widest row; beside the others it is white.
    """
    width = max(line.shape[1] for line in lines)
    full = [np.pad(v, ((0, 0), (0, width - v.shape[1]), (0, 0)), constant_values=1) for v in lines]
    return (np.vstack(full).astype(np.float32).clip(0, 1) * 255 + 0.5).astype(np.uint8)


def baked_picture(head: BakedHead, view: Reference) -> np.ndarray:
    """The baked head as the reference's camera sees it: (H, W, 3) float32."""
    gaussians = view.posed(baked_gaussians(head, view.expression))
    return _picture(gaussians, view.camera, view.background)


def _reference(
    head: TrainedHead,
    pictures: PictureCache,
    view: View,
    expression: torch.Tensor,
    neutral: tuple[float, float, float],
    posed: Posed,
) -> Reference:
    """The reference of a recorded view; `neutral` replaces a background that is not known."""
    picture = pictures.picture(view, _CPU)
    plate = pictures.background(view, _CPU)
    behind, truth = staged(picture, plate, torch.tensor(neutral))
    seen = truth.numpy().astype(np.float16)
    return reference(head, view.camera, expression, behind, seen, posed)


def reference(
    head: TrainedHead,
    camera: Camera,
    expression: torch.Tensor,
    background: torch.Tensor,
    truth: np.ndarray | None = None,
    posed: Posed = _as_they_are,
) -> Reference:
    """A reference with the picture of the exact head, drawn on the device of the head.

    Args:
        head: The exact head.
        camera: The camera in canonical head space.
        expression: (B,) float32.
        background: (3,) or (H, W, 3) colour behind the head.
        truth: (H, W, 3) recorded picture, if there is one.
        posed: Puts the shoulders of a portrait where they were.
    """
    background = background.to(head.model.device)
    with torch.no_grad():
        gaussians = posed(head.model(expression))
        exact = _picture(gaussians, camera, background).astype(np.float16)
    return Reference(camera, expression.numpy(), background, exact, truth, posed)


def _picture(gaussians: Gaussians, camera: Camera, background: torch.Tensor) -> np.ndarray:
    with torch.no_grad():
        drawn = render(gaussians.to(background.device), [camera], background)
    return drawn.rgb[0].cpu().numpy()  # (H, W, 3)


def mean_of(values: Iterable[float | None]) -> float | None:
    """Mean of the values that are not None, rounded to 4 decimals; None where all are None."""
    found = [value for value in values if value is not None]
    return round(float(np.mean(found)), 4) if found else None
