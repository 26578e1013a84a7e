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
from typing import Literal

import numpy as np
import tyro

from ico3d.body.settings import BodySettings
from ico3d.body.training.views import BodyViews
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.pictures import View
from ico3d.capture.reading.layer_cache import READERS
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
        warmup: First steps of that training, which see the middle frame alone.
        step: Milliseconds of a step.
        cache_gib: Memory for its pictures, GiB, or auto.
        cache_dir: Folder for those that do not fit in memory.
        json: Where to write the figures.
    """

    capture: tyro.conf.Positional[Path]
    views: int = 300
    height: int = 0
    window: int = 0
    steps: int = 4000
    warmup: int = BodySettings().warmup_steps
    step: float = 20.0
    cache_gib: float | Literal["auto"] = BodySettings().cache_gib
    cache_dir: str = ""
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
            capture.image_bytes(camera, frame)
            capture.mask_bytes(camera, frame)
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
        begin, computed = time.perf_counter(), time.process_time()
        pictures = BodyViews(capture, range(self.window), self.cache_gib, self.cache_dir)
        ready, prepared = time.perf_counter() - begin, time.process_time() - computed
        views = pictures.views
        center = [view for view in views if view.frame == self.window // 2]
        order = {len(v): Epochs([0, len(v)], len(v)) for v in (views, center)}

        def seen(step: int) -> list[View]:
            return center if step < self.warmup else views

        def place(step: int) -> int:
            return order[len(seen(step))].at(step)

        waits, computed = [], time.process_time()
        for index in range(self.steps):
            pictures.expect(range(index, self.steps), lambda step: seen(step)[place(step)])
            begin = time.perf_counter()
            pictures.readable(seen(index), place(index))
            waits.append(time.perf_counter() - begin)
            time.sleep(self.step / 1000)
        epoch = self.warmup + len(views)
        return {
            "views": len(views),
            "readers": READERS,
            "first_step_s": ready,
            "mask_cpu_s": prepared / len(views),
            "picture_cpu_s": (time.process_time() - computed) / len(views),
            "waiting_share": _share(waits, self.step),
            "waiting_share_first_epoch": _share(waits[:epoch], self.step),
            "waiting_share_later": _share(waits[epoch:], self.step),
            "memory_mib": resident(),
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
