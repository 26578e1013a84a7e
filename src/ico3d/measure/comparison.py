"""Scores rendered pictures against recorded ones, whoever rendered them."""

import os
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.decoding import DAMAGED, FORMATS, open_picture
from ico3d.capture.video import open_video
from ico3d.common.psnr import psnr
from ico3d.errors import CaptureError
from ico3d.measure.faces.comparison import FaceComparison
from ico3d.measure.lips import LandmarkReader
from ico3d.measure.pictures.temporal import TemporalFlicker
from ico3d.measure.scores import PICTURE, Scores, add_picture
from ico3d.splat.device import CPU

KINDS = (*FORMATS, "WEBP")
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
"""Files of a folder that count as pictures."""
WIDEST = 1 << 14
"""Upper limit of the short side of videos in pixels: none is scaled down."""


def pictures_of(path: Path, fps: float) -> Iterator[np.ndarray]:
    """The pictures of a folder in the order of their names, or of a video.

    Args:
        path: Folder with `SUFFIXES`, or a video file.
        fps: Pictures per second to take out of a video, each the nearest in time.

    Yields:
        float32 RGB (H, W, 3) in [0, 1].

    Raises:
        CaptureError: If there is no picture, or one cannot be read.
    """
    if not os.path.isdir(path):
        for picture in open_video(path, WIDEST).frames(fps):
            yield picture.astype(np.float32) / 255
        return
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    if not files:
        raise CaptureError(f"{path} has no pictures.")
    for file in files:
        try:
            with open_picture(file, str(file), KINDS) as opened:
                picture = np.asarray(opened.convert("RGB"), np.float32) / 255
        except DAMAGED as error:
            raise CaptureError(f"{file} cannot be read as a picture: {error}.") from None
        yield picture


def compare_pictures(
    predicted: Iterable[np.ndarray],
    truth: Iterable[np.ndarray],
    masks: Iterable[np.ndarray] | None = None,
    device: torch.device = CPU,
) -> dict[str, float | None]:
    """Metrics of pictures, as means over consecutive frames of one camera.

    Args:
        predicted: (H, W, 3) in [0, 1] each.
        truth: As many pictures of the same sizes.
        masks: (H, W) in [0, 1] each, the person; None for the whole picture.
        device: Device for LPIPS and MS-SSIM.

    Returns:
        The metrics `PICTURE`, `psnr_mask` (None without masks) and `temporal_flicker`, on the mask
        where there is one.

    Raises:
        CaptureError: If numbers or sizes of pictures differ, or there is none.
    """
    scores, flicker = Scores({name: [] for name in (*PICTURE, "psnr_mask")}), TemporalFlicker()
    people = None if masks is None else iter(masks)
    for frame, (seen, true) in enumerate(paired(predicted, truth)):
        add_picture(scores, seen, true, device)
        mask = None if people is None else next(people, None)
        if mask is not None:
            scores.add("psnr_mask", psnr(seen, true, mask))
        flicker.add(0, frame, seen, true, mask)
    return scores.means() | {"temporal_flicker": flicker.mean()}


def compare_faces(
    predicted: Iterable[np.ndarray],
    truth: Iterable[np.ndarray],
    fps: float,
    reader: LandmarkReader,
) -> dict[str, float | None]:
    """Metrics of a face in consecutive pictures: lips, blendshapes, identity.

    Args:
        predicted: (H, W, 3) in [0, 1] each.
        truth: As many pictures of the same sizes.
        fps: Pictures per second.
        reader: What finds the faces.

    Returns:
        The metrics `ico3d.measure.faces.comparison.METRICS`.

    Raises:
        CaptureError: If numbers or sizes of pictures differ, or there is none.
    """
    found = FaceComparison(reader.rigidity)
    for seen, true in paired(predicted, truth):
        found.add(reader.face(seen), reader.face(true))
    return found.figures(fps, reader.names)


def paired(
    predicted: Iterable[np.ndarray], truth: Iterable[np.ndarray]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pictures in pairs.

    Raises:
        CaptureError: If numbers or sizes of pictures differ, or there is none.
    """
    count = 0
    for seen, true in zip_longest(predicted, truth):
        if seen is None or true is None:
            more = "rendered" if true is None else "recorded"
            raise CaptureError(
                f"there are more {more} pictures than the {count} of the other side."
            )
        if seen.shape != true.shape:
            sizes = [f"{picture.shape[1]} x {picture.shape[0]}" for picture in (seen, true)]
            raise CaptureError(f"picture {count} is {sizes[0]} rendered, but {sizes[1]} recorded.")
        yield seen, true
        count += 1
    if not count:
        raise CaptureError("there are no pictures to compare.")
