"""Milliseconds of drawing and of training steps, with their memory."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from full_size.models import ball, camera
from ico3d.body.settings import settings_for
from ico3d.body.training.needs import needs_of_body
from ico3d.body.training.train_clip import BodyJob
from ico3d.capture.formats import open_capture
from ico3d.common.device import DeviceName
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, needs_of_head
from ico3d.measure.stopwatch import Stopwatch
from ico3d.protocols.report import Column, Value
from ico3d.splat.render import render
from ico3d.training.dry_run import Needs

WARM = 3
"""Pictures that are drawn before those that are timed."""
DRAWING = (
    Column("picture", "picture, ms", 2),
    Column("gradients", "picture and gradients, ms", 2),
    Column("peak_mib", "memory of the GPU, MiB", 0),
)
STEPS = (
    Column("ms", "a step, ms", 1),
    Column("peak_mib", "memory of the GPU, MiB", 0),
    Column("checkpoint_mib", "checkpoint, MiB", 0),
    Column("steps", "steps of the paper", 0),
    Column("minutes", "all of these, minutes", 1),
)


def drawing_row(
    device: torch.device, count: int, width: int, height: int, runs: int
) -> dict[str, Value]:
    """Medians for a scene of random Gaussians."""
    gaussians, view = ball(count, device), camera(width, height)
    leaves = gaussians.map(lambda t: t.clone().requires_grad_())

    def step() -> None:
        render(leaves, [view]).rgb.square().mean().backward()

    reset_peak(device)
    with torch.no_grad():
        picture = _median(lambda: render(gaussians, [view]), device, runs)
    both = _median(step, device, runs)
    return {"picture": picture, "gradients": both, "peak_mib": peak(device)}


def _median(work: Callable[[], object], device: torch.device, runs: int) -> float:
    """Median milliseconds of some work, with all that the device does of it."""
    for _ in range(WARM):
        work()
    watch = Stopwatch(device)
    for _ in range(runs):
        with watch.picture():
            work()
    return watch.within(0.5)


def reset_peak(device: torch.device) -> None:
    """Begins to look for the largest memory of a GPU anew."""
    if device.type == "cuda":
        torch.cuda.reset_peak_memory_stats(device)


def peak(device: torch.device) -> float | None:
    """Largest memory of a GPU in MiB; None without one."""
    return torch.cuda.max_memory_allocated(device) / 2**20 if device.type == "cuda" else None


def head_row(recording: Path, count: int, device: DeviceName) -> dict[str, Value]:
    """Steps of a head by the paper's settings, as they are at the end of the training."""
    settings = PRESETS["paper"]
    initial = replace(settings.initial, gaussians=min(count, settings.initial.gaussians))
    density = replace(settings.density, max_gaussians=count)
    job = HeadJob(
        "speech", "full", "builtin", 0, replace(settings, initial=initial, density=density)
    )
    return _row(needs_of_head(open_capture(recording), job, device), settings.steps)


def body_row(recording: Path, folder: Path, count: int, device: DeviceName) -> dict[str, Value]:
    """Steps of a window of SWinGS++ by the paper's settings, as they are at its end.

    Args:
        recording: A recording of a body.
        folder: Folder for the plan of its windows.
        count: Number of Gaussians.
        device: Where to compute.
    """
    settings = settings_for("paper", "swings++")
    initial = replace(settings.initial, gaussians=min(count, settings.initial.gaussians))
    density = replace(settings.density, max_gaussians=count)
    job = BodyJob("swings++", 0, replace(settings, initial=initial, density=density), device=device)
    return _row(needs_of_body(open_capture(recording), folder, job), settings.steps)


def _row(needs: Needs, steps: int) -> dict[str, Value]:
    milliseconds = 1000 * needs.end.seconds
    return {
        "gaussians": needs.end.gaussians,
        "ms": milliseconds,
        "peak_mib": needs.device_memory / 2**20 or None,
        "checkpoint_mib": needs.end.saved / 2**20,
        "steps": steps,
        "minutes": milliseconds * steps / 60_000,
    }
