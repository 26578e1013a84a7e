"""Measuring a trained head on frames of a capture."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from rich.progress import track

from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError
from ico3d.head.expressions import ExpressionTrack
from ico3d.head.trained import TrainedHead
from ico3d.head.views import PictureCache, View, view_of
from ico3d.measure.lips import LandmarkReader, landmark_reader, lip_correlation, lip_gap, lip_lag_ms
from ico3d.measure.metrics import lmd, psnr, psnr_mouth
from ico3d.measure.scores import Scores, add_picture, write_pictures
from ico3d.measure.stopwatch import Stopwatch
from ico3d.splat.render import render

FACING = np.array([0.0, 0.0, 1.0])
"""Where the face looks in canonical head space."""


class HeadRenderer:
    """Renders a trained head as a capture's cameras would see it."""

    def __init__(self, head: TrainedHead, capture: Capture):
        """Binds the head to the capture that drives it."""
        self._head = head
        self._track: ExpressionTrack = head.track(capture)
        self._pictures = PictureCache(capture, 0)
        self.watch = Stopwatch(head.model.device)

    @torch.no_grad()
    def picture(self, view: View) -> np.ndarray:
        """(H, W, 3) the head over the capture's background, clipped to [0, 1]."""
        expression = self._track.at(view.frame)
        background = self._pictures.background(view, self._head.model.device)
        with self.watch.picture():
            rendering = render(self._head.model(expression), [view.camera], background)
        return rendering.rgb[0].clamp(0, 1).cpu().numpy()


def evaluate_head(
    head: TrainedHead, capture: Capture, frames: Sequence[int], images: Path | None
) -> dict[str, float | str | None]:
    """All metrics of design section 2.

    Args:
        head: The trained head; it is drawn where its model is.
        capture: Where truth comes from; it may be another one than the head was trained on.
        frames: Consecutive frames to measure.
        images: Folder for pictures, or None.

    Returns:
        Metric keys to values, None where this capture does not allow the metric.

    Raises:
        CaptureError: If the capture lacks what drives the head, or has no picture in the frames.
    """
    renderer = HeadRenderer(head, capture)
    scores = _quality(renderer, capture, frames, images)
    result: dict[str, float | str | None]
    result = {"psnr": None, "psnr_mask": None, "psnr_mouth": None, "ssim": None, **scores.means()}
    result |= _lips(renderer, capture, frames)
    result["num_gaussians"] = len(head.model)
    result |= renderer.watch.figures()
    result["train_seconds"] = head.summary.get("train_seconds")
    return result


def _quality(
    renderer: HeadRenderer, capture: Capture, frames: Sequence[int], images: Path | None
) -> Scores:
    """Picture metrics over all recorded views of the frames."""
    scores = Scores()
    views = list(PictureCache(capture, 0).views(frames))
    if not views:
        raise CaptureError(f"{capture.path} has no picture in the frames to measure.")
    for view in track(views, "pictures", transient=True):
        truth = capture.image(view.camera_index, view.frame)
        mask = capture.head_mask(view.camera_index, view.frame)
        landmarks = capture.landmarks(view.camera_index, view.frame)
        assert truth is not None
        predicted = renderer.picture(view)
        add_picture(scores, predicted, truth)
        scores.add("psnr_mask", None if mask is None else psnr(predicted, truth, mask))
        mouth = None if landmarks is None else psnr_mouth(predicted, truth, landmarks)
        scores.add("psnr_mouth", mouth)
        if images is not None:
            write_pictures(images, view, predicted, truth, mask)
    return scores


def most_frontal_camera(capture: Capture, frames: Sequence[int]) -> int:
    """The camera that faces the head most squarely, averaged over some of the frames."""
    some = frames[:: max(1, len(frames) // 16)]

    def squareness(camera: int) -> float:
        centers = [view_of(capture, camera, f).camera.camera_to_world[:3, 3] for f in some]
        return float(np.mean([center @ FACING / np.linalg.norm(center) for center in centers]))

    return max(range(len(capture.cameras)), key=squareness)


def _lips(
    renderer: HeadRenderer, capture: Capture, frames: Sequence[int]
) -> dict[str, float | None]:
    """Lip metrics on consecutive frames of the most frontal camera."""
    reader = landmark_reader()
    if reader is None:
        return {"lmd": None, "lip_correlation": None, "lip_lag_ms": None}
    camera = most_frontal_camera(capture, frames)
    with reader:
        pairs = list(_landmark_pairs(renderer, reader, capture, camera, frames))
    both = [(seen, true) for seen, true in pairs if seen is not None and true is not None]
    gaps, true_gaps = (np.array([_gap_or_nan(pair[side]) for pair in pairs]) for side in (0, 1))
    return {
        "lmd": float(np.mean([lmd(seen, true) for seen, true in both])) if both else None,
        "lip_correlation": lip_correlation(gaps, true_gaps),
        "lip_lag_ms": lip_lag_ms(gaps, true_gaps, capture.fps),
    }


def _landmark_pairs(
    renderer: HeadRenderer,
    reader: LandmarkReader,
    capture: Capture,
    camera: int,
    frames: Sequence[int],
) -> Iterator[tuple[np.ndarray | None, np.ndarray | None]]:
    """Landmarks of the rendered and the true frame: the capture's, or seen in its picture."""
    for frame in track(frames, "lips", transient=True):
        truth = capture.landmarks(camera, frame)
        if truth is None:
            picture = capture.image(camera, frame)
            truth = None if picture is None else reader.read(picture)
        yield reader.read(renderer.picture(view_of(capture, camera, frame))), truth


def _gap_or_nan(landmarks: np.ndarray | None) -> float:
    return float("nan") if landmarks is None else lip_gap(landmarks)
