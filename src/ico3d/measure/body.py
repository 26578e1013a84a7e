"""Measures a trained body with the cameras that were not used for training, in all frames."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from rich.progress import track

from ico3d.body.model_folder import ROUNDING, TrainedBody
from ico3d.body.planning.windows import Window
from ico3d.capture.capture import Capture
from ico3d.capture.parts.held_out import scored_pictures
from ico3d.capture.pictures import View, train_cameras
from ico3d.common.psnr import psnr
from ico3d.errors import CaptureError
from ico3d.measure.flicker import border_flicker, novel_cameras
from ico3d.measure.part_metrics import moving_pixels, psnr_moving
from ico3d.measure.pictures.temporal import TemporalFlicker
from ico3d.measure.scores import PICTURE, Scores, add_picture, write_pictures
from ico3d.measure.stopwatch import Stopwatch
from ico3d.splat.device import CPU
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

QUALITY = (*PICTURE[:1], "psnr_mask", "psnr_moving", *PICTURE[1:], "temporal_flicker")
"""Metrics of a picture; for several pictures, the mean over those that have a value."""


class Drawn(Protocol):
    """A model of a body, or of a whole person, that can be drawn."""

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time in seconds."""
        ...


class BodyRenderer:
    """Renders a body or a whole person as a capture's cameras would see it."""

    def __init__(self, drawn: Drawn, capture: Capture, device: torch.device):
        """Takes a model on `device`, and the capture with clock, cameras and clean plates."""
        self._drawn, self._capture, self.device = drawn, capture, device
        self._plate = lru_cache(1)(self._read_plate)
        self.watch = Stopwatch(device)

    @torch.no_grad()
    def picture(self, camera: int, frame: int) -> np.ndarray:
        """(H, W, 3) the body over the clean plate, or over black without one; limited to [0, 1]."""
        behind = self._plate(camera)
        seen = self._capture.cameras[camera]
        with self.watch.picture():
            gaussians = self._drawn.gaussians(frame / self._capture.fps)
            rgb = render(gaussians, [seen], behind).rgb[0]
        return rgb.clamp(0, 1).cpu().numpy()

    def _read_plate(self, camera: int) -> torch.Tensor | None:
        found = self._capture.background(camera)
        return None if found is None else torch.from_numpy(found).to(self.device)


@dataclass(frozen=True)
class Truth:
    """A recorded picture, prepared for comparison with a rendered body.

    Attributes:
        picture: (H, W, 3) in [0, 1]; without a clean plate, the person cut out by the mask on
            black.
        mask: (H, W) in [0, 1], 1 on the person, or None.
        moving: (H, W) bool, the pixels of `moving_pixels`.
        whole: Whether the whole picture can be compared, because there is a plate or a mask.
    """

    picture: np.ndarray
    mask: np.ndarray | None
    moving: np.ndarray
    whole: bool


class BodyTruth:
    """The recorded pictures of a capture; the last few are cached, as each is read three times."""

    def __init__(self, capture: Capture):
        """Takes the capture; nothing is read yet."""
        self._capture = capture
        self._image = lru_cache(3)(capture.image)
        self._has_plate = lru_cache(1)(lambda camera: capture.background(camera) is not None)

    def at(self, camera: int, frame: int) -> Truth | None:
        """The recorded picture of a camera in a frame, or None if it was not recorded."""
        picture = self._image(camera, frame)
        if picture is None:
            return None
        around = [f for f in (frame - 1, frame + 1) if 0 <= f < self._capture.num_frames]
        neighbours = [other for f in around if (other := self._image(camera, f)) is not None]
        moving = moving_pixels(picture, neighbours)
        mask, plate = self._capture.mask(camera, frame), self._has_plate(camera)
        if not plate and mask is not None:
            picture = picture * mask[..., None]
        return Truth(picture, mask, moving, plate or mask is not None)


def evaluate_body(
    body: TrainedBody,
    capture: Capture,
    cameras: Sequence[int] | None = None,
    frames: Sequence[int] | None = None,
    spans: Sequence[Window] | None = None,
    images: Path | None = None,
    drawn: Drawn | None = None,
) -> dict:
    """All metrics of a body (docs/architecture.md, "Metrics"), as means over pictures.

    The body is rendered over the capture's clean plates. Without plates it is rendered over black
    and compared with the person cut out by the mask. `psnr_moving` is the PSNR on moving pixels of
    the person, which differ by more than 25/255 from the frame before or after or lie within 3
    pixels of such a pixel.

    Args:
        body: The trained body; it is drawn on its own device.
        capture: The recording to compare with.
        cameras: Indices of the cameras to measure with; by default the capture's test cameras.
        frames: Frames to measure; by default all that the body covers.
        spans: Spans of frames to report separately; by default the body's windows. A frame in two
            spans counts for the earlier one, which shows it.
        images: Folder for pictures, or None for no pictures.
        drawn: Model that is drawn: the whole person of an avatar whose body is `body`; by default
            the body alone. `flicker` and `num_gaussians` are always those of the body.

    Returns:
        Values by metric, None where the capture does not allow the metric; `per_window`,
        `per_camera` and `per_frame`: lists of the same for parts of the pictures. `flicker` is the
        mean of `per_border` (see `border_flicker`), None for a single window. `camera_colors` is
        there where training cameras have colour maps: `identity`, with which all are drawn here.

    Raises:
        CaptureError: If there is no picture to compare with.
    """
    cameras = _test_cameras(capture) if cameras is None else cameras
    frames = _shown(body, capture) if frames is None else frames
    renderer = BodyRenderer(drawn or body, capture, body.device)
    found = _measured(renderer, capture, cameras, frames, images)
    if not found:
        raise CaptureError(f"{capture.path} has no picture in the frames to measure.")
    result: dict = _means(found.values())
    borders = border_flicker(
        body, novel_cameras([capture.cameras[i] for i in train_cameras(capture)])
    )
    result["flicker"] = float(np.mean(borders)) if borders else None
    result["num_gaussians"] = sum(map(len, body.models))
    result |= renderer.watch.figures()
    result["train_seconds"] = body.summary.get("train_seconds")
    if any(model.camera_colors is not None for model in body.models):
        result["camera_colors"] = "identity"  # a test camera's own map could only be learnt from it
    result["per_window"] = _per_window(found, spans or body.windows)
    result["per_border"] = [
        {"frame": window.last, "flicker": value}
        for window, value in zip(body.windows, borders, strict=False)
    ]
    result["per_camera"] = [
        {"camera": capture.cameras[camera].name}
        | _means(values for (other, _), values in found.items() if other == camera)
        for camera in cameras
    ]
    result["per_frame"] = [
        {"frame": frame} | _means(values for (_, other), values in found.items() if other == frame)
        for frame in frames
    ]
    return result


PictureScores = dict[str, float | None]
"""Values of one picture by metric."""


def _test_cameras(capture: Capture) -> tuple[int, ...]:
    return scored_pictures(capture, "test")[0]


def _shown(body: TrainedBody, capture: Capture) -> range:
    """The frames of a capture that a body shows."""
    return range(min(capture.num_frames, int(body.seconds * capture.fps + ROUNDING) + 1))


def _measured(
    renderer: BodyRenderer,
    capture: Capture,
    cameras: Sequence[int],
    frames: Sequence[int],
    images: Path | None,
) -> dict[tuple[int, int], PictureScores]:
    """Scores by camera and frame."""
    truths, flicker = BodyTruth(capture), TemporalFlicker()
    chosen = [(camera, frame) for camera in cameras for frame in frames]
    found = {}
    for camera, frame in track(chosen, "pictures", transient=True):
        truth = truths.at(camera, frame)
        if truth is None:
            continue
        predicted = renderer.picture(camera, frame)
        values = picture_scores(predicted, truth, renderer.device)
        change = flicker.add(camera, frame, predicted, truth.picture, truth.mask)
        found[camera, frame] = values | {"temporal_flicker": change if truth.whole else None}
        if images is not None:
            view = View(camera, frame, capture.cameras[camera])
            write_pictures(images, view, predicted, truth.picture, truth.mask)
    return found


def picture_scores(
    predicted: np.ndarray, truth: Truth, device: torch.device = CPU
) -> PictureScores:
    """Metrics of one picture.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: The recorded picture.
        device: Device for LPIPS and MS-SSIM.
    """
    scores = Scores({name: [] for name in QUALITY})
    if truth.whole:
        add_picture(scores, predicted, truth.picture, device)
    if truth.mask is not None and truth.mask.any():
        box = _box(truth.mask)
        seen, true, mask = predicted[box], truth.picture[box], truth.mask[box]
        scores.add("psnr_mask", psnr(seen, true, mask))
        scores.add("psnr_moving", psnr_moving(seen, true, mask * truth.moving[box]))
    return scores.means()


def _box(mask: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of what is inside of a mask: metrics on the mask need no more."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _per_window(found: dict[tuple[int, int], PictureScores], spans: Sequence[Window]) -> list[dict]:
    """Means over the frames of each span; a shared frame belongs to the earlier one."""
    result, begin = [], -1
    for span in spans:
        inside = range(max(span.first, begin), span.last + 1)
        means = _means(values for (_, frame), values in found.items() if frame in inside)
        result.append({"first": span.first, "last": span.last} | means)
        begin = span.last + 1
    return result


def _means(pictures: Iterable[PictureScores]) -> PictureScores:
    """Mean of each metric over the pictures that have it."""
    scores = Scores({name: [] for name in QUALITY})
    for values in pictures:
        for name, value in values.items():
            scores.add(name, value)
    return scores.means()
