"""Compares the speed of the CPU rasteriser with another program, on equal projected Gaussians."""

import ctypes
import importlib.util
import os
import subprocess
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class Scene:
    """N projected Gaussians; all arrays are float32.

    Attributes:
        means2d: (N, 2) pixels.
        conics: (N, 3) entries xx, xy, yy of the inverse 2D covariances.
        colors: (N, 3) in [0, 1].
        opacities: (N,).
        depths: (N,) along the camera's z.
        extents: (N, 2) half sizes of bounding boxes in pixels.
        size: Image width and height in pixels.
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
        """Compiles the kernels by running them once."""
        self.scene = scene
        self.bin()
        self.forward()
        self.backward()

    def bin(self) -> None:
        """Sorts the splats into tiles."""
        from ico3d.splat.cpu.tiles import bin_splats

        s = self.scene
        self.tiles = bin_splats(
            s.means2d, s.conics, s.opacities, s.depths, s.extents, s.size, s.size
        )

    def forward(self) -> None:
        """Draws the picture."""
        from ico3d.splat.cpu.forward import draw, splat_records

        s = self.scene
        self.records = splat_records(s.means2d, s.conics, s.opacities, s.colors)
        self.image, self.light = draw(self.records, self.tiles)

    def backward(self) -> None:
        """Computes gradients of ½·Σ image², by colour (3), opacity, mean (2), conic (3)."""
        from ico3d.splat.cpu.backward import draw_backward

        no_light = np.zeros_like(self.light)
        found = draw_backward(
            self.records, self.tiles, self.image, self.light, self.image, no_light
        )
        self.gradients = found[:, [6, 7, 8, 5, 0, 1, 2, 3, 4]]


class Theirs:
    """The other program's library, behind its C interface."""

    def __init__(self, library: ctypes.CDLL, scene: Scene):
        """Runs everything once as a warm-up."""
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
        """Sorts the splats into tiles and draws the picture."""
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
        """Computes gradients of ½·Σ image²."""
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
    """Executes the other program's benchmark script, which must define `scene()` and `build()`.

    Raises:
        SettingsError: If the file is missing or does not define both.
    """
    spec = importlib.util.spec_from_file_location("raster_opponent", path)
    if not os.path.isfile(path) or spec is None or spec.loader is None:
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


@dataclass(frozen=True)
class Comparison:
    """Times and differences of the two rasterisers on one scene; times are medians.

    Attributes:
        gaussians: Number of Gaussians in the scene.
        size: Image width and height in pixels.
        pairs: Number of pairs of a splat and a tile that ico3d draws, to which cost should be
            proportional.
        ours_binning_ms: ico3d: sorting splats into tiles, milliseconds.
        ours_forward_ms: ico3d: drawing alone, milliseconds.
        ours_backward_ms: ico3d: gradients, milliseconds.
        theirs_forward_ms: Other program: binning and drawing, milliseconds.
        theirs_backward_ms: Other program: gradients, milliseconds.
        image_difference: Largest difference between the pictures.
        gradient_difference: Largest difference between gradients, relative to the largest gradient
            of each parameter.
    """

    gaussians: int
    size: int
    pairs: int
    ours_binning_ms: float
    ours_forward_ms: float
    ours_backward_ms: float
    theirs_forward_ms: float
    theirs_backward_ms: float
    image_difference: float
    gradient_difference: float

    @property
    def name(self) -> str:
        """Name of the scene, such as 20k_256."""
        return f"{self.gaussians / 1000:g}k_{self.size}"

    @property
    def forward_ratio(self) -> float:
        """Time of binning and drawing, ours / theirs."""
        return (self.ours_binning_ms + self.ours_forward_ms) / self.theirs_forward_ms

    @property
    def backward_ratio(self) -> float:
        """Time of gradients, ours / theirs."""
        return self.ours_backward_ms / self.theirs_backward_ms

    @property
    def ours_total_ms(self) -> float:
        """Milliseconds of ico3d's binning, drawing and gradients."""
        return self.ours_binning_ms + self.ours_forward_ms + self.ours_backward_ms

    @property
    def theirs_total_ms(self) -> float:
        """Milliseconds of the other program's picture and gradients."""
        return self.theirs_forward_ms + self.theirs_backward_ms

    @property
    def ratio(self) -> float:
        """`ours_total_ms` / `theirs_total_ms`."""
        return self.ours_total_ms / self.theirs_total_ms

    def figures(self) -> dict[str, Any]:
        """All values, JSON-serialisable."""
        ratios = {
            "forward_ratio": self.forward_ratio,
            "backward_ratio": self.backward_ratio,
            "ratio": self.ratio,
        }
        return asdict(self) | {"ours_total_ms": self.ours_total_ms} | ratios


def compare(path: Path, count: int, size: int, runs: int) -> Comparison:
    """Times both programs in turns, so that disturbances of the machine affect both.

    Args:
        path: The other program's script.
        count: Number of Gaussians.
        size: Image width and height in pixels, a multiple of 16.
        runs: Number of turns.

    Returns:
        Median times and differences.

    Raises:
        SettingsError: If the other program cannot be used or built, or the size does not suit it.
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
    steps = (ours.bin, ours.forward, ours.backward, theirs.forward, theirs.backward)
    times = np.array([[_timed(step) for step in steps] for _ in range(runs)])  # (runs, 5)
    largest = np.abs(theirs.gradients).max(0)
    difference = np.abs(ours.gradients - theirs.gradients).max(0) / largest
    return Comparison(
        count,
        size,
        sum(len(band.entries) for band in ours.tiles.bands()),
        *map(float, np.median(times, 0)),
        image_difference=float(np.abs(ours.image - theirs.image).max()),
        gradient_difference=float(difference.max()),
    )
