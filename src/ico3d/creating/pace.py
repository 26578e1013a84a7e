"""How fast this machine is, now, and with how many threads."""

import statistics
import time

import numpy as np
import torch

from ico3d.common.camera import Camera, look_at
from ico3d.common.device import DeviceName
from ico3d.common.native.jit import numba
from ico3d.splat.device import computing_device, wait_for
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

GAUSSIANS, SIDE, TIMED = 8_000, 256, 6
"""Size of the step that is timed: Gaussians, pixels on each side, and how often it is done."""

MOST_THREADS = numba.get_num_threads()
"""Number of threads that numba has; asked before fewer are used."""


def set_pace(device: DeviceName) -> float:
    """Lets as many threads compute as are fastest, all or one, and returns how fast they are.

    Threads of short steps wait for one another: where other programs are at work, two of them were
    four times slower than one (measured on two busy cores).

    Returns:
        Seconds of one optimisation step of a standard size, forwards and backwards.

    Raises:
        SettingsError: If CUDA is asked for and does not work.
    """
    place = computing_device(device)
    counts = sorted({1, MOST_THREADS})
    found = {count: _step_seconds(place, count) for count in counts}
    fastest = min(counts, key=found.__getitem__)
    _use_threads(fastest)
    return found[fastest]


def _use_threads(count: int) -> None:
    numba.set_num_threads(count)
    torch.set_num_threads(count)


def _step_seconds(place: torch.device, threads: int) -> float:
    """Median seconds of a step with so many threads."""
    _use_threads(threads)
    ball = _ball().to(place)
    means = ball.means.requires_grad_()
    lens = np.array([[2.3 * SIDE, 0, SIDE / 2], [0, 2.3 * SIDE, SIDE / 2], [0, 0, 1]])
    camera = Camera(SIDE, SIDE, lens, look_at((0, 0, 0.7), (0, 0, 0)))
    seconds = []
    for _ in range(TIMED + 1):
        begin = time.perf_counter()
        render(ball, [camera]).rgb.mean().backward()
        wait_for(place)
        seconds.append(time.perf_counter() - begin)
        means.grad = None
    return statistics.median(seconds[1:])  # kernels are loaded in the first


def _ball() -> Gaussians:
    """A ball the size of a head."""
    rng = np.random.default_rng(0)
    return Gaussians(
        torch.from_numpy(rng.normal(0, 0.06, (GAUSSIANS, 3))).float(),
        torch.tensor([1.0, 0, 0, 0]).repeat(GAUSSIANS, 1),
        torch.full((GAUSSIANS, 3), 0.004),
        torch.full((GAUSSIANS,), 0.5),
        torch.from_numpy(rng.random((GAUSSIANS, 3))).float(),
    )
