"""What files of 3D Gaussians cost and lose: sizes, times, and errors of a round trip.

    python bench/files.py src/ico3d/chat/data/demo.ico3d --json files.json

The bundle's head at rest is written, read and rendered; times and memory are those of random
Gaussians of SH degree 3.
"""

import json
import sys
import tempfile
import time
import tracemalloc
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro

from ico3d.avatar.render_bundle import baked_gaussians, visitor_camera
from ico3d.bundle.format import Bundle
from ico3d.cli import run_script
from ico3d.splat.files.formats import read_gaussians, write_gaussians
from ico3d.splat.files.raw import RawGaussians
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.losses import tensor_psnr
from ico3d.splat.render import render


@dataclass(frozen=True)
class Bench:
    """What to write and read.

    Attributes:
        bundle: An avatar whose head is written.
        count: Random Gaussians for times and memory.
        size: Pixels of the picture's sides.
        json: Where to write the table.
    """

    bundle: tyro.conf.Positional[Path]
    count: int = 200_000
    size: int = 512
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, one row per format and set."""
        bundle = Bundle.open(self.bundle)
        baked, poses = bundle.require_head()
        expression = np.zeros(baked.expression_size, np.float32)
        head = RawGaussians.from_gaussians(baked_gaussians(baked, expression))
        camera = visitor_camera(bundle.manifest.camera, self.size, self.size)
        camera = camera.moved(poses[0])
        rows = []
        for suffix in (".ply", ".spz"):
            back, row = round_trip(head, suffix)
            row["psnr"] = psnr(head.to_gaussians(), back.to_gaussians(), camera)
            rows.append({"set": "head", **row, **errors(head, back)})
            random = random_gaussians(self.count)
            back, row = round_trip(random, suffix)
            rows.append({"set": "random", **row, **errors(random, back)})
        for row in rows:
            print(json.dumps(row))
        if self.json is not None:
            self.json.write_text(json.dumps(rows, indent=1))


def random_gaussians(count: int) -> RawGaussians:
    """Gaussians of SH degree 3 in a room of 4 m, 7 mm large at the median."""
    random = np.random.default_rng(0)
    return RawGaussians(
        means=random.uniform(-2, 2, (count, 3)).astype(np.float32),
        dc=random.normal(size=(count, 3)).astype(np.float32),
        rest=random.normal(0, 0.1, (count, 15, 3)).astype(np.float32),
        opacities=random.normal(0, 3, count).astype(np.float32),
        log_scales=random.normal(-5, 1, (count, 3)).astype(np.float32),
        quats=random.normal(size=(count, 4)).astype(np.float32),
    )


def round_trip(gaussians: RawGaussians, suffix: str) -> tuple[RawGaussians, dict]:
    """What comes back from a file, and what that took."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"gaussians{suffix}"
        start = time.perf_counter()
        write_gaussians(path, gaussians)
        written = time.perf_counter()
        back = read_gaussians(path)
        end = time.perf_counter()
        tracemalloc.start()
        read_gaussians(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        size = path.stat().st_size
    return back, {
        "format": suffix,
        "count": len(gaussians),
        "bytes_per_gaussian": size / len(gaussians),
        "write_s": written - start,
        "read_s": end - written,
        "memory_per_file_byte": peak / size,
    }


def errors(before: RawGaussians, after: RawGaussians) -> dict:
    """Largest and root mean square differences of activated values."""
    a, b = before.to_gaussians(), after.to_gaussians()
    assert a.sh is not None and b.sh is not None
    alignment = torch.nn.functional.cosine_similarity(a.quats.double(), b.quats.double())
    differences = {
        "position_mm": 1000 * (a.means - b.means),
        "scale_mm": 1000 * (a.scales - b.scales),
        "opacity": a.opacities - b.opacities,
        "angle_degrees": torch.rad2deg(2 * alignment.abs().clamp(max=1).acos()),
        "sh": a.sh - b.sh,
    }
    return {
        name: [float(d.abs().max()), float(d.square().mean().sqrt())]
        for name, d in differences.items()
    }


def psnr(before: Gaussians, after: Gaussians, camera) -> float:
    """Of the picture of what came back against what was written, dB."""
    with torch.no_grad():
        a, b = (render(g, [camera], torch.ones(3)).rgb[0] for g in (before, after))
    return tensor_psnr(a, b)


if __name__ == "__main__":
    sys.exit(run_script(Bench))
