"""Parity and speed of rendering on a GPU, and how long a head trains there.

    python bench/gpu.py --json gpu.json [--capture CAPTURE]

Where CUDA does not work the same is timed on the CPU, and parity is left out; --device decides as
for ico3d's verbs. Prints the table for docs/benchmarks.md, with the device's name. Exit status 1:
the backends differ too much.
"""

import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.common.camera import Camera, look_at
from ico3d.common.device import DeviceName
from ico3d.head.model import HeadModel, HeadShape
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.splat.device import decided, device_name
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

VALUES, GRADIENTS = 1e-4, 1e-3
"""Greatest differences between the backends, relative to the largest value."""
RIMS = 0.002
"""Share of the numbers that may differ more: a pixel at a splat's rim is drawn with alpha 1/255, or
not at all, by the last bit of its distance."""


def camera(width: int, height: int) -> Camera:
    """Looks at the origin from 1.5 m away."""
    focal = 1.2 * height
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(width, height, intrinsics, look_at((0.0, 0.0, 1.5), (0.0, 0.0, 0.0)))


def scene(count: int, device: str, seed: int = 0) -> Gaussians:
    """Gaussians as small as those of a trained person, in a ball of 0.5 m."""
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(count, 3))
    means *= 0.5 * rng.random((count, 1)) ** (1 / 3) / np.linalg.norm(means, axis=1, keepdims=True)
    values = (
        means,
        rng.normal(size=(count, 4)),
        np.exp(rng.uniform(np.log(0.002), np.log(0.012), (count, 3))),
        rng.uniform(0.05, 0.95, count),
        rng.random((count, 3)),
    )
    return Gaussians(*(torch.from_numpy(v).float().to(device) for v in values))


def median_ms(work: Callable[[], object], device: str, runs: int) -> float:
    """Median milliseconds of some work, kernels included."""
    times = []
    for run in range(runs + 3):
        start = time.perf_counter()
        work()
        if device == "cuda":
            torch.cuda.synchronize()
        times.append(time.perf_counter() - start if run >= 3 else np.inf)
    return 1e3 * float(np.median(times[3:]))


def parity() -> dict[str, float]:
    """How far CPU and CUDA are apart: pictures, and every gradient."""
    results = {}
    for device in ("cpu", "cuda"):
        leaves = scene(5_000, device).map(lambda t: t.requires_grad_())
        views = [camera(256, 256), camera(256, 256).moved(np.diag([-1.0, 1, -1, 1]))]
        poses = torch.from_numpy(np.stack([v.world_to_camera for v in views])).requires_grad_()
        picture = render(leaves, views, world_to_camera=poses)
        weights = torch.from_numpy(np.random.default_rng(1).random(picture.rgb.shape)).float()
        ((picture.rgb * weights.to(device)).sum() + picture.depth.mean()).backward()
        gradients = {name: v.grad for name, v in vars(leaves).items() if v is not None}
        values = {"rgb": picture.rgb, "alpha": picture.alpha, "depth": picture.depth}
        results[device] = values | gradients | {"poses": poses.grad}
    return {
        name: _difference(results["cuda"][name].detach().cpu(), wanted.detach())
        for name, wanted in results["cpu"].items()
    }


def _difference(found: Tensor, wanted: Tensor) -> float:
    """The greatest but for those at rims, relative to the largest value."""
    apart = np.quantile((found - wanted).abs().numpy(), 1 - RIMS)
    return float(apart / wanted.abs().max())


def raster_rows(device: str, runs: int) -> dict[str, float]:
    """Milliseconds of drawing, and of drawing with gradients, by scene."""
    rows = {}
    for count, width, height in ((20_000, 256, 256), (100_000, 512, 512), (150_000, 1920, 1080)):
        gaussians, view = scene(count, device), camera(width, height)
        leaves = gaussians.map(lambda t: t.clone().requires_grad_())
        name = f"{count // 1000}k at {width}×{height}"
        with torch.no_grad():
            rows[f"{name}, picture"] = median_ms(lambda: render(gaussians, [view]), device, runs)  # noqa: B023

        def step() -> None:
            render(leaves, [view]).rgb.square().mean().backward()  # noqa: B023

        rows[f"{name}, picture and gradients"] = median_ms(step, device, runs)
    return rows


def head_rows(device: str, runs: int) -> dict[str, float]:
    """Milliseconds of a head's frame at 512², from expression to picture."""
    rows, view = {}, camera(512, 512)
    for count in (12_000, 50_000):
        torch.manual_seed(0)
        model = HeadModel(HeadShape(39, features=32, hidden=64, frequencies=6), count)
        start = scene(count, "cpu")
        model.means.data = 0.3 * start.means
        model.log_scales.data = start.scales.log()
        model.basis.data.normal_()
        model.to(device)
        expression = torch.rand(39, device=device)
        with torch.no_grad():
            rows[f"head of {count // 1000}k at 512×512"] = median_ms(
                lambda: render(model(expression), [view]),  # noqa: B023
                device,
                runs,
            )
    return rows


@dataclass(frozen=True)
class Bench:
    """What to measure.

    Attributes:
        json: Where to write the figures.
        capture: Also trains a head on this one, the CPU preset with blendshapes.
        runs: Repetitions; medians are reported.
        device: Where to compute.
    """

    json: Path
    capture: Path | None = None
    runs: int = 30
    device: DeviceName = "auto"

    def run(self) -> int:
        """Measures, prints, writes; the exit status."""
        device = decided(self.device)
        capture = self.capture and open_capture(self.capture)
        name = device_name(torch.device(device))
        if device == "cpu":
            name = f"cpu ({platform.machine()}, {os.cpu_count()} cores)"
        figures: dict = {"device": name, "torch": torch.__version__}
        figures["ms"] = raster_rows(device, self.runs) | head_rows(device, self.runs)
        if device == "cuda":
            figures["parity"] = parity()
        if capture is not None:
            figures["training_seconds"] = self._train(capture)
        self.json.write_text(json.dumps(figures, indent=1))
        print(
            f"{figures['device']}, torch {figures['torch']}\n\n| | ms | per second |\n|---|---|---|"
        )
        for row, ms in figures["ms"].items():
            print(f"| {row} | {ms:.2f} | {1000 / ms:.0f} |")
        for row, difference in figures.get("parity", {}).items():
            print(f"| CPU against CUDA, {row} | {difference:.1e} | |")
        if self.capture is not None:
            print(f"| training a head | {1000 * figures['training_seconds']:.0f} | |")
        return int(not _within_bounds(figures.get("parity", {})))

    def _train(self, capture: Capture) -> float:
        job = HeadJob("blendshapes", "full", "builtin", 0, PRESETS["cpu"])
        with tempfile.TemporaryDirectory() as folder:
            head = train_head(capture, Path(folder), job, device=self.device)
        return head.summary["train_seconds"]


def _within_bounds(differences: dict[str, float]) -> bool:
    return all(
        value <= (VALUES if name in ("rgb", "alpha", "depth") else GRADIENTS)
        for name, value in differences.items()
    )


if __name__ == "__main__":
    sys.exit(run_script(Bench))
