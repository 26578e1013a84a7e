"""What reading a capture costs: time and memory of random views.

python bench/captures.py path/to/0012_11.smc --height 612 --json captures.json
"""

import gc
import json
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.cli import run_script


@dataclass(frozen=True)
class Bench:
    """What to read.

    Attributes:
        capture: A capture of any format.
        views: Pictures, with their masks, drawn at random.
        height: Pixels to scale them down to; as they are where 0.
        json: Where to write the figures.
    """

    capture: tyro.conf.Positional[Path]
    views: int = 300
    height: int = 0
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, one line."""
        begin = time.perf_counter()
        capture = open_capture(self.capture)
        opened = time.perf_counter() - begin
        if self.height:
            capture = ResizedCapture(capture, self.height)
        random = np.random.default_rng(0)
        sizes, begin = [], time.perf_counter()
        for _ in range(self.views):
            camera, frame = random.integers((len(capture.cameras), capture.num_frames)).tolist()
            capture.image(camera, frame)
            capture.mask(camera, frame)
            sizes.append(resident())
        seconds = (time.perf_counter() - begin) / self.views
        row = {
            "cameras": len(capture.cameras),
            "frames": capture.num_frames,
            "open_s": opened,
            "view_s": seconds,
            "largest_mib": max(sizes),
            "peak_mib": peak(),
            "growth_mib": float(np.mean(sizes[-50:]) - np.mean(sizes[50:100])),
        }
        print(json.dumps(row))
        if self.json:
            self.json.write_text(json.dumps(row, indent=1))


def resident() -> float:
    """MiB that this process holds, after what it no longer needs is gone."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def peak() -> float:
    """MiB that this process ever held."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


if __name__ == "__main__":
    sys.exit(run_script(Bench))
