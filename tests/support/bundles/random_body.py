"""A small body in the real format: random Gaussians that move at random, for tests of the file."""

from pathlib import Path

import numpy as np

from ico3d.bundle.format import write_bundle
from ico3d.bundle.manifest import CameraInfo, Loss, Manifest, Persona, Provenance
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.bundle.windows.info import BodyInfo, WindowInfo, window_file
from support.bundles.random_bundle import thumbnail

SPANS, SIZES, RANKS, CLUSTERS = ((0, 4), (4, 6)), (20, 23), (5, 3, 2), 3


def random_window(
    count: int,
    ranks: tuple[int, int, int],
    samples: int,
    clusters: int = CLUSTERS,
    seed: int = 0,
) -> BakedWindow:
    rng = np.random.default_rng(seed)
    quats = rng.normal(size=(count, 4))
    quats *= 32767 / np.linalg.norm(quats, axis=1, keepdims=True)

    def basis(rank: int, size: int) -> np.ndarray:
        return rng.integers(-32767, 32768, (rank, count, size)).astype(np.int16)

    return BakedWindow(
        means=rng.normal(0, 0.5, (count, 3)).astype(np.float32),
        quats=quats.astype(np.int16),
        scales=rng.uniform(0.2, 0.3, (count, 3)).astype(np.float16),
        rgba=rng.integers(0, 256, (count, 4)).astype(np.uint8),
        clusters=rng.permutation(np.arange(count) % clusters).astype(np.uint8),
        position_basis=basis(ranks[0], 3),
        rotation_basis=basis(ranks[1], 4),
        scale_basis=basis(ranks[2], 3),
        coefficients=rng.normal(0, 3e-6, (samples, clusters, sum(ranks))).astype(np.float32),
    )


def random_windows() -> list[BakedWindow]:
    return [
        random_window(size, RANKS, 2 * (last - first) + 1, seed=first)
        for size, (first, last) in zip(SIZES, SPANS, strict=True)
    ]


def body_manifest(windows: list[BakedWindow]) -> Manifest:
    infos = [
        WindowInfo(*span, window.num_gaussians, CLUSTERS, window.ranks, window_file(i))
        for i, (span, window) in enumerate(zip(SPANS, windows, strict=True))
    ]
    return Manifest(
        name="random body",
        head=None,
        body=BodyInfo(15.0, 2, (-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), tuple(infos)),
        speech=None,
        camera=CameraInfo((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0),
        background=(0.85, 0.87, 0.9),
        persona=Persona("Random", "", ()),
        loss=Loss(None, None, None),
        provenance=Provenance("random", ("random numbers",), "none needed", "CC0-1.0"),
    )


def body_files(windows: list[BakedWindow]) -> dict[str, bytes]:
    names = [window_file(i) for i in range(len(windows))]
    files = {name: w.to_bytes(name) for name, w in zip(names, windows, strict=True)}
    return files | {"thumbnail.png": thumbnail()}


def write_random_body(path: Path) -> Manifest:
    windows = random_windows()
    return write_bundle(path, body_manifest(windows), body_files(windows))
