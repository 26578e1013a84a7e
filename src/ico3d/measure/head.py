"""Measures a trained head on frames of a capture."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import torch
from rich.progress import track
from torch import Tensor

from ico3d.capture.capture import Capture, Sound
from ico3d.common.psnr import psnr
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.head.expressions import ExpressionTrack, turn_values
from ico3d.head.model_folder import TrainedHead
from ico3d.head.portrait.shoulders import shoulders_of
from ico3d.head.views import (
    GREY,
    SHOWS_MOUTH,
    Picture,
    PictureCache,
    View,
    squareness,
    staged,
    view_of,
)
from ico3d.measure.faces.comparison import METRICS, FaceComparison
from ico3d.measure.lips import LandmarkReader, landmark_reader
from ico3d.measure.part_metrics import psnr_mouth
from ico3d.measure.pictures.temporal import TemporalFlicker
from ico3d.measure.scores import Scores, add_picture, write_pictures
from ico3d.measure.stopwatch import Stopwatch
from ico3d.measure.sync.pipeline import sync_or_none
from ico3d.splat.render import render

log = logging.getLogger(__name__)


class HeadRenderer:
    """Renders a trained head as a capture's cameras would see it."""

    def __init__(self, head: TrainedHead, capture: Capture):
        """Takes the head and the capture that drives it."""
        self._head, self._capture = head, capture
        self._track: ExpressionTrack = head.track(capture)
        pictures = PictureCache(capture, 0)
        self._shoulders = shoulders_of(capture, head.model.shape.neck, pictures)
        self.watch = Stopwatch(head.model.device)

    @torch.no_grad()
    def picture(self, view: View, behind: Tensor) -> np.ndarray:
        """(H, W, 3) the head over a picture (H, W, 3) or a colour (3,), limited to [0, 1]."""
        expression = self._track.at(view.frame)
        if self._head.turn is not None:
            values = turn_values(self._head.turn, self._capture, [view.frame])  # (1, 3)
            expression = torch.cat([expression, values[0]])  # (B + 3,)
        if self._shoulders is not None:
            self._shoulders.motion(view.frame)  # looks at the picture, which is no drawing
        with self.watch.picture():
            gaussians = self._head.model(expression)
            if self._shoulders is not None:
                gaussians = self._shoulders.posed(gaussians, view.frame)
            rendering = render(gaussians, [view.camera], behind.to(self._head.model.device))
        return rendering.rgb[0].clamp(0, 1).cpu().numpy()


def evaluate_head(
    head: TrainedHead, capture: Capture, frames: Sequence[int], images: Path | None
) -> dict[str, float | int | str | None]:
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
    result: dict[str, float | int | str | None]
    reader = landmark_reader()
    with nullcontext() if reader is None else reader:
        scores = _quality(renderer, reader, capture, frames, images)
        faces = _faces(renderer, reader, capture, frames)
    result = {"psnr": None, "psnr_mask": None, "psnr_mouth": None, "ssim": None, **scores.means()}
    result |= faces
    if reader is not None:
        _say_why(result, capture)
    result |= _sync(renderer, capture, frames)
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


def _say_why(result: dict[str, float | int | str | None], capture: Capture) -> None:
    """Warns where the faces seen did not suffice for a metric."""
    keys = ("psnr_mouth", *METRICS)
    lacking = [key for key in keys if result[key] is None]
    if lacking:
        log.warning(
            "%s: not measured: %s, as too few pictures of these frames show a face, recorded and "
            "rendered.", capture.path, ", ".join(lacking),
        )  # fmt: skip


def most_frontal_camera(capture: Capture, frames: Sequence[int]) -> int:
    """Index of the camera that faces the head most directly, on average over some of the frames."""
    some = [frames[place] for place in spread(len(frames), 16)]

    def average(camera: int) -> float:
        return float(np.mean([squareness(view_of(capture, camera, f).camera) for f in some]))

    cameras = range(len(capture.cameras))
    seeing = [c for c in cameras if any(capture.has_image(c, frame) for frame in frames)]
    return max(seeing, key=average)


def _faces(
    renderer: HeadRenderer,
    reader: LandmarkReader | None,
    capture: Capture,
    frames: Sequence[int],
) -> dict[str, float | None]:
    """Metrics of the face on consecutive frames of the most frontal camera."""
    if reader is None:
        return dict.fromkeys(METRICS)
    camera = most_frontal_camera(capture, frames)
    found = FaceComparison(reader.rigidity)
    for frame, rendered in rendered_frames(renderer, capture, camera, frames, "faces"):
        picture = capture.image(camera, frame)
        true = None if picture is None else reader.face(picture)
        found.add(reader.face(rendered), true, capture.landmarks(camera, frame))
    return found.figures(capture.fps, reader.names)


def _sync(
    renderer: HeadRenderer, capture: Capture, frames: Sequence[int]
) -> dict[str, float | int | str | None]:
    """How well the lips fit the sound, on consecutive frames of the most frontal camera."""
    sound = capture.audio()
    scores = None
    if sound is None:
        log.warning("%s has no sound: lip synchronisation is not measured.", capture.path)
    else:
        camera = most_frontal_camera(capture, frames)
        begin = round(frames[0] / capture.fps * sound.rate)
        shown = rendered_frames(renderer, capture, camera, frames, "lips and sound")
        scores = sync_or_none(
            (picture for _, picture in shown),
            capture.fps,
            Sound(sound.samples[begin:], sound.rate),
            renderer.watch.device,
        )
    if scores is None:
        return dict.fromkeys(("sync_c", "sync_d", "sync_offset", "sync_faces_by"))
    return dict(scores.figures())


def rendered_frames(
    renderer: HeadRenderer, capture: Capture, camera: int, frames: Sequence[int], what: str
) -> Iterator[tuple[int, np.ndarray]]:
    """Frames as a camera would see the head, before what is behind it there, or grey.

    Args:
        renderer: Draws the head.
        capture: The recording that drives it.
        camera: Index of the camera.
        frames: Frames to draw.
        what: Label of the progress bar.

    Yields:
        Number and picture (H, W, 3) of each frame.
    """
    for frame in track(frames, what, transient=True):
        plate = capture.behind(camera, frame)
        behind = torch.full((3,), GREY) if plate is None else torch.from_numpy(plate)
        yield frame, renderer.picture(view_of(capture, camera, frame), behind)
