"""Measures how long pictures take to compute."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

from ico3d.splat.device import device_name, wait_for


class Stopwatch:
    """Times the computation of pictures on a device.

    Attributes:
        device: The device.
    """

    def __init__(self, device: torch.device):
        """Takes the device; nothing is timed yet."""
        self.device = device
        self._seconds: list[float] = []

    @contextmanager
    def picture(self) -> Iterator[None]:
        """Times the `with` block, all of its work on CUDA and none of what CUDA did before."""
        wait_for(self.device)
        begin = time.perf_counter()
        yield
        wait_for(self.device)
        self._seconds.append(time.perf_counter() - begin)

    def figures(self) -> dict[str, float | str]:
        """`ms_per_frame`, the median in milliseconds, `fps`, 1000 of these, and the `device`."""
        median = self.within(0.5)
        return {
            "ms_per_frame": median,
            "fps": 1000 / median,
            "device": device_name(self.device),
        }

    def within(self, share: float) -> float:
        """Milliseconds within which a share of the pictures, 0 to 1, were computed."""
        return float(np.quantile(self._seconds, share) * 1000)
