"""The protocol of the viewer: how fast each part of a person is drawn (paper, its last table)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.camera_path import orbit, ring_around
from ico3d.avatar.models import open_model
from ico3d.avatar.render_bundle import BakedAvatar, backdrop_gaussians, baked_gaussians, pose_at
from ico3d.bundle.format import Bundle
from ico3d.common.camera import Camera
from ico3d.measure.stopwatch import Stopwatch
from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Report, Section, Table
from ico3d.scene.model_folder import TrainedScene
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render

SIZES = ((512, 512), (1920, 1080))
"""Widths and heights of the pictures in pixels."""
PICTURES, WARM = 30, 3
"""Pictures of each row that are timed, and those before them, which are not."""
PEAK = "memory of the GPU, MiB"
COMBINATIONS = (
    ("background",),
    ("background", "body"),
    ("background", "head"),
    ("background", "body", "head"),
)
"""The rows of the paper's table."""

Part = Callable[[float], Gaussians]
"""Returns the Gaussians of a part in the world at a time in seconds."""


def viewer_columns(sizes: Sequence[tuple[int, int]]) -> list[Column]:
    """Columns of the rows that `viewer_rows` gives for pictures of these sizes."""
    timed = [
        column
        for width, height in sizes
        for column in (
            Column(f"fps_{width}x{height}", f"{width}×{height}: FPS", 1, "more"),
            Column(f"ms_{width}x{height}", "ms", 2),
            Column(f"p95_{width}x{height}", "95 % within, ms", 2),
        )
    ]
    gaussians, peak = Column("gaussians", "Gaussians", 0), Column("peak_mib", PEAK, 0)
    return [gaussians, *timed, peak]


@dataclass(frozen=True)
class Staged:
    """A person before a background, part by part.

    Attributes:
        parts: `background`, `body` and `head`, those that there are.
        seconds: Length of the body's clip.
        device: Where Gaussians are computed and drawn.
    """

    parts: dict[str, Part]
    seconds: float
    device: torch.device


def staged(model: Path, background: Path | None, device: torch.device) -> Staged:
    """Opens a person, as trained or as a bundle, and a background.

    A trained person is drawn through its networks, as by the paper's viewer; a bundle as a page
    draws it, by what baking left of them.

    Args:
        model: Folder of `ico3d assemble`, or a bundle.
        background: Folder of `ico3d train static`; by default a bundle's own background.
        device: Where to compute.

    Raises:
        ModelError: If a path holds something else.
        BundleError: If a bundle lacks body or head, or is damaged.
    """
    person = open_model(model, TrainedAvatar, Bundle)
    parts, seconds = _baked(person) if isinstance(person, Bundle) else _trained(person, device)
    if background is not None:
        scene = open_model(background, TrainedScene).to(device).scene.gaussians()
        parts["background"] = lambda _: scene
    return Staged(parts, seconds, device)


def _trained(avatar: TrainedAvatar, device: torch.device) -> tuple[dict[str, Part], float]:
    avatar.to(device)
    return {"body": avatar.body.gaussians, "head": avatar.head_gaussians}, avatar.seconds


def _baked(bundle: Bundle) -> tuple[dict[str, Part], float]:
    person = BakedAvatar.of(bundle)
    size = person.head.expression_size
    random = np.random.default_rng(0)

    def head(seconds: float) -> Gaussians:
        expression = random.random(size).astype(np.float32)  # a new one, as in speech
        pose = pose_at(person.world_from_head, seconds * person.fps)
        return baked_gaussians(person.head, expression).transform(pose)

    parts: dict[str, Part] = {"body": person.body_gaussians, "head": head}
    behind = backdrop_gaussians(bundle)
    if behind is not None:
        parts["background"] = lambda _: behind
    return parts, person.seconds


def frame_rate(
    parts: Sequence[Part], cameras: Sequence[Camera], seconds: float, device: torch.device
) -> dict[str, float]:
    """How long pictures take, from the time of the clip to the finished picture.

    Every picture is of another moment, by another camera, and is awaited: CUDA has finished when
    the time is taken.

    Args:
        parts: What is drawn; a background colour alone if empty.
        cameras: One camera for each picture; the first `WARM` are not timed.
        seconds: Length of the clip.
        device: Where to compute.

    Returns:
        `fps` of the median, `ms`, `p95` in milliseconds, and the number of `gaussians`.
    """
    watch, count = Stopwatch(device), 0
    for index, camera in enumerate(cameras):
        if index == WARM:
            watch = Stopwatch(device)
        moment = seconds * index / len(cameras)
        with torch.no_grad(), watch.picture():
            drawn = [part(moment).to(device) for part in parts]
            if drawn:
                render(cat(drawn), [camera])
        count = sum(map(len, drawn))
    median = watch.within(0.5)
    return {"fps": 1000 / median, "ms": median, "p95": watch.within(0.95), "gaussians": count}


def viewer_rows(
    shown: Staged, sizes: Sequence[tuple[int, int]] | None = None, pictures: int | None = None
) -> list[dict[str, float | str | None]]:
    """A row for each combination of parts that there is.

    Args:
        shown: The parts.
        sizes: Widths and heights of the pictures in pixels; `SIZES` if None.
        pictures: Number of pictures of each size that are timed; `PICTURES` if None.

    Raises:
        ModelError: If there is neither body nor head.
    """
    points = cat([shown.parts[name](0.0) for name in ("body", "head") if name in shown.parts])
    places = points.means.detach().cpu().numpy()
    combinations = {tuple(n for n in names if n in shown.parts): names for names in COMBINATIONS}
    rows = []
    for present in combinations:
        if not present:
            continue
        row: dict[str, float | str | None] = {"name": " + ".join(present)}
        if shown.device.type == "cuda":
            torch.cuda.reset_peak_memory_stats(shown.device)
        for width, height in sizes or SIZES:
            cameras = orbit(
                ring_around(places), places, (pictures or PICTURES) + WARM, width, height
            )
            parts = [shown.parts[name] for name in present]
            found = frame_rate(parts, cameras, shown.seconds, shown.device)
            row["gaussians"] = found.pop("gaussians")
            row |= {f"{name}_{width}x{height}": value for name, value in found.items()}
        if shown.device.type == "cuda":
            row["peak_mib"] = torch.cuda.max_memory_allocated(shown.device) / 2**20
        rows.append(row)
    return rows


def measure_viewer(model: Path, out: Path, background: Path | None, device: torch.device) -> Report:
    """Times a person part by part and writes a report.

    Args:
        model: Folder of `ico3d assemble`, or a bundle.
        out: Folder of the report.
        background: Folder of `ico3d train static`; by default a bundle's own background.
        device: Where to compute.

    Returns:
        The report, which has been written.
    """
    shown = staged(model, background, device)
    rows = viewer_rows(shown)
    text = (
        f"Medians of {PICTURES} pictures, each of another moment of the clip and by another camera "
        "of an orbit, from the moment's Gaussians to the finished picture. The paper's viewer "
        "draws background, body and head with 70.6 FPS on an RTX 2080 and 105.3 FPS on a 4090 "
        "Laptop; it names neither the picture's size nor the number of Gaussians."
    )
    if "background" not in shown.parts:
        text += " There is no background."
    table = Table(viewer_columns(SIZES), rows, "drawn")
    section = Section("Frames per second, part by part", text, table)
    facts = facts_of(device, model=str(model), background=str(background or "the bundle's own"))
    report = Report("How fast is the viewer?", facts, [section], {"rows": rows})
    report.write(out)
    return report
