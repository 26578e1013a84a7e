"""Says before a training how much time, memory and disk it takes, by doing a few of its steps."""

import os
import resource
import shutil
import statistics
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from ico3d.splat.device import CPU, wait_for
from ico3d.training.checkpoint import size_of_tensors
from ico3d.training.loop import Trainee

TIMED = 6
"""Steps that are timed with each number of Gaussians, after they were done once untimed.

Pictures are read, kernels compiled and moments allocated in the untimed ones.
"""
GB = 1e9


class Growing(Trainee, Protocol):
    """A trainee whose Gaussians can be made as many as density control may make them."""

    def __len__(self) -> int:
        """The number of Gaussians."""
        ...

    def grow(self, count: int) -> None:
        """Splits Gaussians at random until there are `count`."""
        ...


@dataclass(frozen=True)
class Timing:
    """What steps cost with one number of Gaussians.

    Attributes:
        gaussians: The number of Gaussians.
        seconds: Median seconds of a step.
        saved: Bytes of a checkpoint.
        kept: Bytes of parameters, without moments and statistics.
    """

    gaussians: int
    seconds: float
    saved: int
    kept: int


@dataclass(frozen=True)
class Needs:
    """What a training takes.

    Attributes:
        steps: Number of all its steps.
        parts: Number of models that are trained, such as windows.
        begin: Cost of steps with the Gaussians that training begins with.
        end: Cost of steps with as many Gaussians as density control may make.
        pictures: Bytes of all decoded pictures of a part.
        cached: Bytes of pictures that memory keeps.
        memory: Largest memory of a process, bytes, with these pictures.
        device_memory: Largest memory of the GPU, bytes; 0 without one.
    """

    steps: int
    parts: int
    begin: Timing
    end: Timing
    pictures: int
    cached: int
    memory: int
    device_memory: int

    @property
    def seconds(self) -> tuple[float, float]:
        """Least and greatest time of all steps: without any new Gaussian, and with all at once."""
        low, high = sorted((self.begin.seconds, self.end.seconds))
        return self.steps * low, self.steps * high

    @property
    def disk(self) -> int:
        """Most bytes on the disk at a time: the models, and a checkpoint beside two before."""
        return self.parts * self.end.kept + 3 * self.end.saved

    def lines(self, folder: Path) -> list[str]:
        """Sentences for the user.

        Args:
            folder: Where the training is to be written.
        """
        low, high = self.seconds
        free = shutil.disk_usage(_existing(folder)).free
        parts = f" in {self.parts} windows, one after another" if self.parts > 1 else ""
        lines = [
            f"time: {_duration(low)} to {_duration(high)} for {self.steps} steps{parts} "
            f"({1000 * self.begin.seconds:.0f} ms with {self.begin.gaussians} Gaussians, "
            f"{1000 * self.end.seconds:.0f} ms with {self.end.gaussians}; {TIMED} steps of each "
            "were timed, the time to read pictures for the first time comes on top)",
            f"pictures: {self.pictures / GB:.2f} GB decoded, {self.cached / GB:.2f} GB of them "
            "stay in memory",
            f"memory: up to {self.memory / GB:.2f} GB, with these pictures",
            f"disk: up to {self.disk / GB:.2f} GB (a checkpoint {self.end.saved / GB:.2f} GB, "
            f"three times while one is written), {free / GB:.0f} GB are free",
        ]
        if self.device_memory:
            lines.insert(3, f"memory of the GPU: up to {self.device_memory / GB:.2f} GB")
        if self.cached < self.pictures:
            lines.append(
                "not all pictures stay in memory: give --cache-dir a folder on a disk with "
                f"{(self.pictures - self.cached) / GB:.2f} GB, or the rest is decoded at each use"
            )
        if self.disk > free:
            lines.append("the disk is too small for this training")
        return lines


def needs_of(
    trainee: Growing, steps: int, most: int, total: int, parts: int, pictures: tuple[int, int]
) -> Needs:
    """Does some of the last steps of a training, which cost the most, and says what all take.

    The trainee cannot be trained afterwards.

    Args:
        trainee: A trainee before its first step.
        steps: Its number of steps.
        most: Largest number of Gaussians.
        total: Number of steps of all parts.
        parts: Number of parts like this one.
        pictures: Bytes of all pictures, and of those that memory keeps, before the first step.
    """
    device = _device(trainee)
    if device.type == "cuda":
        torch.cuda.reset_peak_memory_stats(device)
    begin = _timed(trainee, steps, device)
    trainee.grow(most)
    end = _timed(trainee, steps, device)
    resident = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    cuda = torch.cuda.max_memory_allocated(device) if device.type == "cuda" else 0
    return Needs(total, parts, begin, end, *pictures, resident + pictures[1], cuda)


def _device(trainee: Growing) -> torch.device:
    """The GPU where any tensor of a trainee is to lie, else the CPU."""
    places = {trainee.place(name) for name in trainee.tensors()}
    return next((place for place in places if place.type == "cuda"), CPU)


def _timed(trainee: Growing, steps: int, device: torch.device) -> Timing:
    """Times the last steps of a training, all of their work on the device."""
    last, seconds = range(max(steps - TIMED, 0), steps), []
    for index in (*last, *last):
        wait_for(device)
        begin = time.perf_counter()
        trainee.step(index)
        wait_for(device)
        seconds.append(time.perf_counter() - begin)
    tensors = trainee.tensors()
    model = {n: t for n, t in tensors.items() if not n.startswith(("moments.", "density."))}
    median = statistics.median(seconds[len(last) :])
    return Timing(len(trainee), median, size_of_tensors(tensors), size_of_tensors(model))


def _duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _existing(folder: Path) -> Path:
    """A folder, or the nearest one above it that is there."""
    places = (folder.absolute(), *folder.absolute().parents)
    return next(path for path in places if os.path.exists(path))
