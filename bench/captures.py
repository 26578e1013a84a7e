"""What reading a capture costs: time and memory of random views, and how long training waits.

python bench/captures.py path/to/0012_11.smc --height 612 --json captures.json
python bench/captures.py path/to/0012_11.smc --window 16 --json captures.json
"""

import gc
import json
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro

from ico3d.body.settings import BodySettings
from ico3d.body.training.views import BodyViews
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.pictures import AHEAD, READERS
from ico3d.cli import run_script
from ico3d.training.epochs import Epochs


@dataclass(frozen=True)
class Bench:
    """What to read.

    Attributes:
        capture: A capture of any format.
        views: Pictures, with their masks, drawn at random.
        height: Pixels to scale them down to; as they are where 0.
        window: Frames of a body's window whose training is measured, too: its steps are pauses of
            `step` milliseconds, as if a GPU computed; none where 0.
        steps: Steps of that training.
        step: Milliseconds of a step.
        cache_gib: Memory for its pictures, GiB.
        json: Where to write the figures.
    """

    capture: tyro.conf.Positional[Path]
    views: int = 300
    height: int = 0
    window: int = 0
    steps: int = 2150
    step: float = 20.0
    cache_gib: float = BodySettings().cache_gib
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
        if self.window:
            row |= self._waiting(capture)
        print(json.dumps(row))
        if self.json:
            self.json.write_text(json.dumps(row, indent=1))

    def _waiting(self, capture: Capture) -> dict[str, float]:
        """How long a window's training waits: before its first step, and for pictures."""
        begin = time.perf_counter()
        pictures = BodyViews(capture, range(self.window), self.cache_gib)
        ready = time.perf_counter() - begin
        views, epochs = pictures.views, Epochs([0], len(pictures.views))
        waits = []
        for index in range(self.steps):
            pictures.expect(views[epochs.at(step)] for step in range(index, index + AHEAD))
            begin = time.perf_counter()
            pictures.example(views[epochs.at(index)], np.zeros(3), torch.device("meta"))
            waits.append(time.perf_counter() - begin)
            time.sleep(self.step / 1000)
        first, last = waits[: len(views)], waits[len(views) :]
        return {
            "views": len(views),
            "readers": READERS,
            "first_step_s": ready,
            "waiting_share": _share(waits, self.step),
            "waiting_share_first_epoch": _share(first, self.step),
            "waiting_share_later": _share(last, self.step),
        }


def _share(waits: list[float], step: float) -> float:
    """The share of time that is waited for pictures, given the seconds waited in each step."""
    total = sum(waits) + len(waits) * step / 1000
    return sum(waits) / total if waits else 0.0


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
