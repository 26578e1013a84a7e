"""Measures how long pictures take to compute."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

from ico3d.splat.device import device_name


class Stopwatch:
    """Times the computation of pictures on a device."""

    def __init__(self, device: torch.device):
        """Takes the device; nothing is timed yet."""
        self._device = device
        self._seconds: list[float] = []

    @contextmanager
    def picture(self) -> Iterator[None]:
        """Times the `with` block, including all work that CUDA still has to finish."""
        begin = time.perf_counter()
        yield
        if self._device.type == "cuda":
            torch.cuda.synchronize(self._device)
        self._seconds.append(time.perf_counter() - begin)

    def figures(self) -> dict[str, float | str]:
        """`ms_per_frame`, the median in milliseconds, and the name of the `device`."""
        return {"ms_per_frame": self.within(0.5), "device": device_name(self._device)}

    def within(self, share: float) -> float:
        """Milliseconds within which a share of the pictures, 0 to 1, were computed."""
        return float(np.quantile(self._seconds, share) * 1000)
