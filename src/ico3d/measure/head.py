"""Measures a trained head on frames of a capture."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import torch
from rich.progress import track
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.head.expressions import ExpressionTrack
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import GREY, Picture, PictureCache, View, staged, view_of
from ico3d.measure.lips import LandmarkReader, landmark_reader, lip_correlation, lip_gap, lip_lag_ms
from ico3d.measure.metrics import lmd, psnr_mouth
from ico3d.measure.pictures.temporal import TemporalFlicker
from ico3d.measure.scores import Scores, add_picture, write_pictures
from ico3d.measure.stopwatch import Stopwatch
from ico3d.splat.render import render

FACING = np.array([0.0, 0.0, 1.0])
"""Viewing direction of the face in canonical head space."""
SHOWS_MOUTH = float(np.cos(np.radians(75.0)))
"""Least cosine of the angle to the face at which a camera sees the mouth well enough."""

log = logging.getLogger(__name__)


class HeadRenderer:
    """Renders a trained head as a capture's cameras would see it."""

    def __init__(self, head: TrainedHead, capture: Capture):
        """Takes the head and the capture that drives it."""
        self._head = head
        self._track: ExpressionTrack = head.track(capture)
        self.watch = Stopwatch(head.model.device)

    @torch.no_grad()
    def picture(self, view: View, behind: Tensor) -> np.ndarray:
        """(H, W, 3) the head over a picture (H, W, 3) or a colour (3,), limited to [0, 1]."""
        expression = self._track.at(view.frame)
        with self.watch.picture():
            rendering = render(
                self._head.model(expression), [view.camera], behind.to(self._head.model.device)
            )
        return rendering.rgb[0].clamp(0, 1).cpu().numpy()


def evaluate_head(
    head: TrainedHead, capture: Capture, frames: Sequence[int], images: Path | None
) -> dict[str, float | str | None]:
    """All metrics of a head (docs/architecture.md, "Metrics").

    Where a capture has no clean background, the person is cut out by the mask, and both pictures
    are shown on the same grey. Where it shows the whole body, what of the person is not the head
    counts as drawn perfectly.

    Args:
        head: The trained head; it is drawn on its model's device.
        capture: The recording to compare with; may differ from that of the training.
        frames: Consecutive frames to measure.
        images: Folder for pictures, or None for no pictures.

    Returns:
        Values by metric; None where the capture does not allow the metric, with a warning that says
        why.

    Raises:
        CaptureError: If the capture lacks what drives the head, or has no picture in these frames.
    """
    renderer = HeadRenderer(head, capture)
    result: dict[str, float | str | None]
    reader = landmark_reader()
    with nullcontext() if reader is None else reader:
        scores = _quality(renderer, reader, capture, frames, images)
        lips = _lips(renderer, reader, capture, frames)
    result = {"psnr": None, "psnr_mask": None, "psnr_mouth": None, "ssim": None, **scores.means()}
    result |= lips
    if reader is not None:
        _say_why(result, capture)
    result["num_gaussians"] = len(head.model)
    result |= renderer.watch.figures()
    result["train_seconds"] = head.summary.get("train_seconds")
    return result


def _quality(
    renderer: HeadRenderer,
    reader: LandmarkReader | None,
    capture: Capture,
    frames: Sequence[int],
    images: Path | None,
) -> Scores:
    """Picture metrics over all recorded views of the frames."""
    scores, flicker, pictures = Scores(), TemporalFlicker(), PictureCache(capture, 0)
    views = pictures.views(frames)
    if not views:
        raise CaptureError(f"{capture.path} has no picture in the frames to measure.")
    for view in track(views, "pictures", transient=True):
        recorded = capture.image(view.camera_index, view.frame)
        person = capture.mask(view.camera_index, view.frame)
        measured = capture.head_mask(view.camera_index, view.frame)
        assert recorded is not None
        cut = None if person is None else torch.from_numpy(person)
        plate = pictures.background(view, torch.device("cpu"))
        moving = capture.behind(view.camera_index, view.frame) if capture.moves_behind else None
        own = None if moving is None else torch.from_numpy(moving)
        behind, target = staged(Picture(torch.from_numpy(recorded), cut, None, own), plate)
        truth, predicted = target.numpy(), renderer.picture(view, behind)
        if capture.shows == "body" and person is not None and measured is not None:
            torso = np.clip(person - measured, 0, 1)[..., None]  # (H, W, 1)
            predicted = predicted + torso * (truth - predicted)
        add_picture(scores, predicted, truth, renderer.watch.device)
        scores.add("psnr_mask", None if measured is None else psnr(predicted, truth, measured))
        change = flicker.add(view.camera_index, view.frame, predicted, truth, measured)
        scores.add("temporal_flicker", change)
        if squareness(view.camera) > SHOWS_MOUTH:
            landmarks = capture.landmarks(view.camera_index, view.frame)
            if landmarks is None and reader is not None:
                landmarks = reader.read(recorded, person)
            mouth = None if landmarks is None else psnr_mouth(predicted, truth, landmarks)
            scores.add("psnr_mouth", mouth)
        if images is not None:
            write_pictures(images, view, predicted, truth, measured)
    return scores


def _say_why(result: dict[str, float | str | None], capture: Capture) -> None:
    """Warns where the faces seen did not suffice for a metric."""
    keys = ("psnr_mouth", "lmd", "lip_correlation", "lip_lag_ms")
    lacking = [key for key in keys if result[key] is None]
    if lacking:
        log.warning(
            "%s: not measured: %s, as too few pictures of these frames show a face, recorded and "
            "rendered.", capture.path, ", ".join(lacking),
        )  # fmt: skip


def squareness(camera: Camera) -> float:
    """Cosine of the angle between the face's and a camera's direction, in canonical head space."""
    center = camera.camera_to_world[:3, 3]
    return float(center @ FACING / np.linalg.norm(center))


def most_frontal_camera(capture: Capture, frames: Sequence[int]) -> int:
    """Index of the camera that faces the head most directly, on average over some of the frames."""
    some = [frames[place] for place in spread(len(frames), 16)]

    def average(camera: int) -> float:
        return float(np.mean([squareness(view_of(capture, camera, f).camera) for f in some]))

    cameras = range(len(capture.cameras))
    seeing = [c for c in cameras if any(capture.has_image(c, frame) for frame in frames)]
    return max(seeing, key=average)


def _lips(
    renderer: HeadRenderer,
    reader: LandmarkReader | None,
    capture: Capture,
    frames: Sequence[int],
) -> dict[str, float | None]:
    """Lip metrics on consecutive frames of the most frontal camera."""
    if reader is None:
        return {"lmd": None, "lip_correlation": None, "lip_lag_ms": None}
    camera = most_frontal_camera(capture, frames)
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
        plate = capture.behind(camera, frame)
        behind = torch.full((3,), GREY) if plate is None else torch.from_numpy(plate)
        truth = capture.landmarks(camera, frame)
        if truth is None:
            picture = capture.image(camera, frame)
            truth = None if picture is None else reader.read(picture)
        yield reader.read(renderer.picture(view_of(capture, camera, frame), behind)), truth


def _gap_or_nan(landmarks: np.ndarray | None) -> float:
    return float("nan") if landmarks is None else lip_gap(landmarks)
