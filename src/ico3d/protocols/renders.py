"""Scores pictures of a talking head against the recorded ones, whoever rendered them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.box import Box
from ico3d.capture.capture import Sound
from ico3d.capture.sound import read_sound_file
from ico3d.errors import CaptureError
from ico3d.measure.comparison import compare_faces, compare_pictures, pictures_of
from ico3d.measure.lips import LandmarkReader, landmark_reader, lip_gap
from ico3d.measure.sync.pipeline import sync_or_none
from ico3d.protocols.charts import draw_lines, draw_strip
from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Picture, Report, Section, Table, Value

FACE_MARGIN = 0.25
"""Margin of the face crop on each side, relative to the longer side of the landmarks' box."""

PICTURE_COLUMNS = (
    Column("psnr", "PSNR", 2, "more"),
    Column("ssim", "SSIM", 4, "more"),
    Column("ms_ssim", "MS-SSIM", 4, "more"),
    Column("lpips_alex", "LPIPS (Alex)", 4, "less"),
    Column("lpips", "LPIPS (VGG)", 4, "less"),
)
LIP_COLUMNS = (
    Column("lmd", "LMD, px", 2, "less"),
    Column("aue_lower", "AUE, lower", 2, "less"),
    Column("aue_upper", "AUE, upper", 2, "less"),
    Column("sync_c", "Sync-C", 3, "more"),
    Column("sync_d", "Sync-D (E)", 3, "less"),
    Column("sync_offset", "offset, frames", 0),
    Column("lip_correlation", "lips: r", 3, "more"),
    Column("lip_lag_ms", "lips: lag, ms", 1),
    Column("blendshape_error_lower", "blendshapes, lower", 3, "less"),
    Column("identity_distance", "identity, %", 2, "less"),
    Column("temporal_flicker", "flicker", 4, "less"),
)
FACE_COLUMNS = (
    Column("psnr_mask", "PSNR, head's mask", 2, "more"),
    Column("psnr_mouth", "PSNR, mouth", 2, "more"),
    *(Column(f"face_{c.key}", f"face: {c.label}", c.digits, c.better) for c in PICTURE_COLUMNS),
)


@dataclass(frozen=True)
class Recorded:
    """The recorded side of a comparison.

    Attributes:
        pictures: Folder of pictures, in the order of their names, or a video.
        fps: Pictures per second.
        masks: Folder of masks of the head or person, one for each picture; None for none.
        sound: Sound from the time of the first picture on; None for none.
        face: The face crop; None where no face is found.
    """

    pictures: Path
    fps: float
    masks: Path | None
    sound: Sound | None
    face: Box | None


def recorded_side(pictures: Path, fps: float, masks: Path | None, sound: Path | None) -> Recorded:
    """Opens the recorded side and looks for the face in it.

    Raises:
        CaptureError: If the pictures cannot be read, or there is no sound where one is named.
    """
    reader = landmark_reader()
    face = None
    if reader is not None:
        with reader:
            found = (reader.read(picture) for picture in pictures_of(pictures, fps))
            face = face_box([landmarks for landmarks in found if landmarks is not None])
    heard = None if sound is None else read_sound_file(sound)
    if sound is not None and heard is None:
        raise CaptureError(f"there is no sound at {sound}.")
    return Recorded(pictures, fps, masks, heard, face)


def face_box(landmarks: Sequence[np.ndarray]) -> Box | None:
    """The face crop of all frames: the box of all landmarks (68, 2) of all frames, with a margin.

    One crop for all frames: errors of a head's place count.
    """
    if not len(landmarks):
        return None
    points = np.concatenate(list(landmarks))  # (F · 68, 2)
    low, high = points.min(0), points.max(0)
    margin = FACE_MARGIN * (high - low).max()
    left, top = (int(value) for value in np.floor(np.maximum(low - margin, 0)))
    right, bottom = (int(value) for value in np.ceil(high + margin))
    return Box(left, top, right - left, bottom - top)


def score_renders(rendered: Path, recorded: Recorded, device: torch.device) -> dict[str, Value]:
    """All metrics of rendered pictures, whole, and of the face crop.

    Args:
        rendered: Folder of pictures, as many as recorded and in the same order, or a video.
        recorded: What they are compared with.
        device: Where LPIPS, MS-SSIM and SyncNet compute.

    Returns:
        Values by metric (docs/architecture.md, "Metrics"); those of the crop begin with `face_`.

    Raises:
        CaptureError: If numbers or sizes of pictures differ.
    """
    fps, masks = recorded.fps, recorded.masks
    found: dict[str, Value] = dict(
        compare_pictures(
            pictures_of(rendered, fps),
            pictures_of(recorded.pictures, fps),
            None if masks is None else (mask[..., 0] for mask in pictures_of(masks, fps)),
            device,
        )
    )
    found |= crop_scores(rendered, recorded, device)
    reader = landmark_reader()
    if reader is not None:
        with reader:
            pairs = pictures_of(rendered, fps), pictures_of(recorded.pictures, fps)
            found |= compare_faces(*pairs, fps, reader)
    return found | sync_row(rendered, recorded, device)


def crop_scores(rendered: Path, recorded: Recorded, device: torch.device) -> dict[str, Value]:
    """Picture metrics of the face crop, each with the prefix `face_`; empty without a face."""
    box = recorded.face
    if box is None:
        return {}
    sides = rendered, recorded.pictures
    crops = [(p[box.cut] for p in pictures_of(side, recorded.fps)) for side in sides]
    found = compare_pictures(*crops, device=device)
    return {f"face_{column.key}": found[column.key] for column in PICTURE_COLUMNS}


def sync_row(pictures: Path, recorded: Recorded, device: torch.device) -> dict[str, Value]:
    """SyncNet's scores of pictures with the recorded sound; empty without sound or weights."""
    if recorded.sound is None:
        return {}
    shown = pictures_of(pictures, recorded.fps)
    scores = sync_or_none(shown, recorded.fps, recorded.sound, device)
    return {} if scores is None else dict(scores.figures())


def lip_gaps(pictures: Path, fps: float, reader: LandmarkReader) -> Iterator[float | None]:
    """Opening of the inner lips in pixels in each picture; None where no face is seen."""
    for picture in pictures_of(pictures, fps):
        landmarks = reader.read(picture)
        yield None if landmarks is None else lip_gap(landmarks)


def render_pictures(out: Path, recorded: Recorded, rendered: dict[str, Path]) -> list[Picture]:
    """Draws a strip of one picture, and the lips over time where faces can be read."""
    middle = sum(1 for _ in pictures_of(recorded.pictures, recorded.fps)) // 2
    truth, *shots = (
        next(islice(pictures_of(path, recorded.fps), middle, None))
        for path in (recorded.pictures, *rendered.values())
    )
    draw_strip(out / "strip.png", truth, dict(zip(rendered, shots, strict=True)))
    shown = [Picture("strip.png", f"Picture {middle}, and its errors")]
    reader = landmark_reader()
    if reader is None:
        return shown
    with reader:
        sides = {"recorded": recorded.pictures, **rendered}
        gaps = {name: list(lip_gaps(path, recorded.fps, reader)) for name, path in sides.items()}
    draw_lines(out / "lips.png", gaps, "picture", "opening of the lips (px)")
    return [*shown, Picture("lips.png", "Opening of the inner lips")]


def measure_renders(
    rendered: Sequence[Path], recorded: Recorded, out: Path, device: torch.device
) -> Report:
    """Scores folders or videos of renders, whoever made them, and writes a report.

    Args:
        rendered: Folders of pictures, or videos; one row each.
        recorded: What they are compared with.
        out: Folder of the report.
        device: Where LPIPS, MS-SSIM and SyncNet compute.
    """
    names = _names(rendered)
    rows = [{"name": name, **score_renders(path, recorded, device)} for name, path in names.items()]
    truth = {"name": "recorded", **sync_row(recorded.pictures, recorded, device)}
    sections = [
        Section("Whole pictures", table=Table(PICTURE_COLUMNS, rows, "renders")),
        Section("The head and the face", table=Table(FACE_COLUMNS, rows, "renders")),
        Section("Lips and face in time", table=Table(LIP_COLUMNS, [truth, *rows], "renders")),
        Section("Pictures", pictures=render_pictures(out, recorded, names)),
    ]
    facts = facts_of(device, recorded=str(recorded.pictures), fps=recorded.fps)
    report = Report("How good are these renders?", facts, sections, {"rows": rows})
    report.write(out)
    return report


def _names(paths: Sequence[Path]) -> dict[str, Path]:
    """Short names for paths: their last parts, or whole where those are the same."""
    short = [path.stem for path in paths]
    return {
        str(path) if short.count(name) > 1 else name: path
        for name, path in zip(short, paths, strict=True)
    }
