"""Times the CPU rasteriser against another one on the same projected Gaussians."""

import ctypes
import importlib.util
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class Scene:
    """Projected Gaussians; all float32.

    Attributes:
        means2d: (N, 2) pixels.
        conics: (N, 3).
        colors: (N, 3).
        opacities: (N,).
        depths: (N,).
        extents: (N, 2) pixels.
        size: Image width and height.
    """

    means2d: np.ndarray
    conics: np.ndarray
    colors: np.ndarray
    opacities: np.ndarray
    depths: np.ndarray
    extents: np.ndarray
    size: int


class Ours:
    """ico3d's kernels: binning, forward, backward."""

    def __init__(self, scene: Scene):
        """Compiles the kernels by a first run."""
        self.scene = scene
        self.bin()
        self.forward()
        self.backward()

    def bin(self) -> None:
        """Finds each tile's splats."""
        from ico3d.splat.cpu.tiles import bin_splats

        s = self.scene
        self.tiles = bin_splats(
            s.means2d, s.conics, s.opacities, s.depths, s.extents, s.size, s.size
        )

    def forward(self) -> None:
        """Draws."""
        from ico3d.splat.cpu.forward import draw, splat_records

        s = self.scene
        self.records = splat_records(s.means2d, s.conics, s.opacities, s.colors)
        self.image, self.light = draw(self.records, self.tiles)

    def backward(self) -> None:
        """Gradients of ½·Σ image²; afterwards colour 3, opacity, mean 2, conic 3."""
        from ico3d.splat.cpu.backward import draw_backward

        no_light = np.zeros_like(self.light)
        found = draw_backward(
            self.records, self.tiles, self.image, self.light, self.image, no_light
        )
        self.gradients = found[:, [6, 7, 8, 5, 0, 1, 2, 3, 4]]


class Theirs:
    """The opponent's library behind its C interface."""

    def __init__(self, library: ctypes.CDLL, scene: Scene):
        """Runs once, so that everything it needs is there."""
        library.bin_c.restype = ctypes.c_int64
        self.library, self.scene = library, scene
        count, size = len(scene.depths), scene.size
        self.image = np.empty((size, size, 3), np.float32)
        self.light = np.empty((size, size), np.float32)
        self.gradients = np.empty((count, 9), np.float32)
        self.offsets = np.empty((size // 16) ** 2 + 1, np.int64)
        self.entries = ctypes.c_void_p()
        self.forward()
        self.backward()

    def forward(self) -> None:
        """Bins and draws."""
        s, at = self.scene, _pointer
        self.library.free_c(self.entries)
        self.pairs = self.library.bin_c(
            *(at(s.means2d), at(s.extents), at(s.depths), len(s.depths), s.size, s.size),
            *(at(self.offsets), ctypes.byref(self.entries)),
        )
        self.library.fwd_c(
            *map(at, (s.means2d, s.conics, s.colors, s.opacities, s.extents, self.offsets)),
            *(self.entries, s.size, s.size, at(self.image), at(self.light)),
        )

    def backward(self) -> None:
        """Gradients of ½·Σ image²."""
        s, at = self.scene, _pointer
        no_light = np.zeros_like(self.light)
        self.library.bwd_c(
            *map(at, (s.means2d, s.conics, s.colors, s.opacities, s.extents, self.offsets)),
            *(self.entries, ctypes.c_int64(self.pairs), len(s.depths), s.size, s.size),
            *map(at, (self.image, self.light, self.image, no_light, self.gradients)),
        )


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def load_opponent(path: Path) -> ModuleType:
    """Runs the benchmark script that the user names; it offers `scene()` and `build()`.

    Raises:
        SettingsError: If the file is not there or offers something else.
    """
    spec = importlib.util.spec_from_file_location("raster_opponent", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise SettingsError(f"--against names no Python file: {path}.")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not (hasattr(module, "scene") and hasattr(module, "build")):
        raise SettingsError(f"{path} is no opponent: it has no scene() and build().")
    return module


def _timed(step: Callable[[], None]) -> float:
    start = time.perf_counter()
    step()
    return 1e3 * (time.perf_counter() - start)


def compare(path: Path, count: int, size: int, runs: int) -> dict[str, Any]:
    """Times both, turn by turn, so that what disturbs the machine disturbs both.

    Args:
        path: The opponent's script.
        count: Gaussians.
        size: Image width and height, a multiple of 16.
        runs: Turns.

    Returns:
        Median milliseconds per phase, their totals and ratio (ours / theirs), and the largest
        differences of the pictures and, relative to the largest value, of the gradients.

    Raises:
        SettingsError: If the opponent cannot be used or built, or the size does not fit it.
    """
    if size % 16:
        raise SettingsError(f"--size must be a multiple of 16 for the opponent, got {size}.")
    opponent = load_opponent(path)
    arrays = [np.ascontiguousarray(a) for a in opponent.scene(count, size, size)]
    scene = Scene(*arrays, size=size)
    try:
        theirs = Theirs(opponent.build(), scene)
    except (OSError, subprocess.CalledProcessError) as error:
        raise SettingsError(f"{path} could not be built: {error}") from error
    ours = Ours(scene)
    steps = {
        "ours_binning_ms": ours.bin,
        "ours_forward_ms": ours.forward,
        "theirs_binning_forward_ms": theirs.forward,
        "ours_backward_ms": ours.backward,
        "theirs_backward_ms": theirs.backward,
    }
    times: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(runs):
        for name, step in steps.items():
            times[name].append(_timed(step))
    return _summary(times, ours, theirs, f"ratio_{count / 1000:g}k_{size}")


def _summary(
    times: dict[str, list[float]], ours: Ours, theirs: Theirs, ratio_key: str
) -> dict[str, Any]:
    """The medians and what follows from them."""
    medians = {name: float(np.median(values)) for name, values in times.items()}
    totals = {
        who: sum(value for name, value in medians.items() if name.startswith(who))
        for who in ("ours", "theirs")
    }
    largest = np.abs(theirs.gradients).max(0)
    difference = np.abs(ours.gradients - theirs.gradients).max(0) / largest
    return {
        **medians,
        "ours_total_ms": totals["ours"],
        "theirs_total_ms": totals["theirs"],
        ratio_key: totals["ours"] / totals["theirs"],
        "image_difference": float(np.abs(ours.image - theirs.image).max()),
        "gradient_difference": float(difference.max()),
    }
