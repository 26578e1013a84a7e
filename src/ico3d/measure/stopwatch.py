"""How long pictures take, and where."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

from ico3d.splat.device import device_name


class Stopwatch:
    """Times pictures that a device computes."""

    def __init__(self, device: torch.device):
        """Has timed nothing yet."""
        self._device = device
        self._seconds: list[float] = []

    @contextmanager
    def picture(self) -> Iterator[None]:
        """Times what happens inside, until CUDA has really done it."""
        begin = time.perf_counter()
        yield
        if self._device.type == "cuda":
            torch.cuda.synchronize(self._device)
        self._seconds.append(time.perf_counter() - begin)

    def figures(self) -> dict[str, float | str]:
        """`ms_per_frame`, the median, and the `device` that it was measured on."""
        milliseconds = float(np.median(self._seconds) * 1000)
        return {"ms_per_frame": milliseconds, "device": device_name(self._device)}
