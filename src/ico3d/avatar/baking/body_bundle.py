"""Bakes a trained body of windows into a bundle that browsers play."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

import numpy as np

from ico3d.avatar import staging
from ico3d.avatar.baked_body import BakedBody, WindowedBody, window_gaussians
from ico3d.avatar.baking import head_cost
from ico3d.avatar.baking.body_cost import (
    MAX_DROP,
    MIN_LIKENESS,
    HeadAt,
    comparison_line,
    loses_at_most,
    measure_window,
    probe_views,
    ring_of_cameras,
    window_pair,
)
from ico3d.avatar.baking.shader_body import SAMPLES_PER_FRAME, Shape, WindowBaker
from ico3d.avatar.baking.telling.about import About
from ico3d.avatar.clip_views import At, recorded_views
from ico3d.avatar.moving import MovingBody
from ico3d.bundle.format import LICENSES, THUMBNAIL, coarse_first, write_bundle
from ico3d.bundle.limits import MAX_MOVED
from ico3d.bundle.manifest import CameraInfo, Loss, Manifest
from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.bundle.windows.info import BodyInfo, WindowInfo, window_file
from ico3d.capture.capture import Capture
from ico3d.errors import BundleError

SHAPES = (
    Shape(16, (3, 2, 1)),
    Shape(32, (4, 2, 2)),
    Shape(32, (5, 3, 2)),
    Shape(32, (7, 2, 2)),
    Shape(48, (7, 2, 2)),
)
"""Shapes tried in this order for each window: about 73, 87, 102, 106, 109 bytes per Gaussian."""
GOOD_DROP = 0.05
"""Loss in dB on the person, against ground truth, up to which no larger shape is tried."""
MAX_BYTES = 110.0
"""Most bytes of a window's file per Gaussian."""
_VISIBLE = 0.1
"""Opacity above which a Gaussian counts for the body's bounding box."""
_STRIP_ROWS = 4
"""Rows of the comparison picture, shared by the windows; each window has at least one."""


class BodyEntries(TypedDict):
    """The fields of a manifest that describe a body: one of them is None."""

    body: BodyInfo | None
    skinned: SkinnedInfo | None


@dataclass(frozen=True)
class WindowResult:
    """A baked window, its file, and what it costs.

    Attributes:
        window: The baked window.
        data: Content of the window's file.
        seconds: Duration of the window.
        loss: Loss of baking, means over pictures of the window.
    """

    window: BakedWindow
    data: bytes
    seconds: float
    loss: Loss

    @property
    def bytes_per_gaussian(self) -> float:
        """Size of the window's file, divided by its number of Gaussians."""
        return len(self.data) / self.window.num_gaussians

    @property
    def drop(self) -> float | None:
        """Loss against ground truth in dB; None where there is no ground truth."""
        return head_cost.drop(self.loss)

    @property
    def acceptable(self) -> bool:
        """Whether loss and size are within the bounds."""
        return self._loses_at_most(MAX_DROP)

    @property
    def good(self) -> bool:
        """Whether the loss is so small, within the bound of size, that no larger shape is tried."""
        return self._loses_at_most(GOOD_DROP)

    def _loses_at_most(self, drop: float) -> bool:
        if self.bytes_per_gaussian > MAX_BYTES:
            return False
        return loses_at_most(self.loss, drop)

    def __str__(self) -> str:
        """One line for people."""
        window = self.window
        shape = f"{window.num_clusters} × {'/'.join(map(str, window.ranks))}"
        return (
            f"{window.num_gaussians} Gaussians, {self.seconds:.2f} s, {shape} components: "
            f"{head_cost.in_words(self.loss)}, {self.bytes_per_gaussian:.1f} bytes per Gaussian"
        )


@dataclass(frozen=True)
class BodyParts:
    """A baked body as a bundle holds it.

    Attributes:
        baked: The body as viewers draw it.
        files: Content of each file, by its name in the bundle.
        entry: The manifest's entry about the body.
        loss: Loss of baking, means over pictures of the body.
    """

    baked: BakedBody
    files: dict[str, bytes]
    entry: BodyInfo | SkinnedInfo
    loss: Loss

    @property
    def entries(self) -> BodyEntries:
        """The manifest's fields about the body."""
        entry = self.entry
        if isinstance(entry, SkinnedInfo):
            return {"body": None, "skinned": entry}
        return {"body": entry, "skinned": None}


def parts_of(results: Sequence[WindowResult], body: MovingBody) -> BodyParts:
    """All baked windows of a body as the parts of a bundle."""
    windows = [result.window for result in results]
    return BodyParts(
        WindowedBody(windows.__getitem__, body.windows, body.fps),
        {window_file(i): result.data for i, result in enumerate(results)},
        body_info(windows, body),
        _mean_loss([result.loss for result in results]),
    )


def bake(
    body: MovingBody, capture: Capture | None, head: HeadAt | None = None
) -> Iterator[WindowResult]:
    """Bakes window after window, each in the first shape that is good, else in the best shape.

    Args:
        body: The exact body.
        capture: The body's recording, to measure with; None measures against the exact body only.
        head: Returns the exact head on the body, which recorded pictures show as well; None where
            there is no head.

    Raises:
        BundleError: If a window has more Gaussians than a bundle can move.
    """
    shapes = _fitting(max(len(body.window_gaussians(i, 0.0)) for i in range(len(body.windows))))
    for index in range(len(body.windows)):
        yield _best(_attempts(body, index, capture, head, shapes))


def check(results: list[WindowResult]) -> None:
    """Refuses results that break a bound.

    Raises:
        BundleError: If loss or size break a bound; the sentence says what was measured.
    """
    for index, result in enumerate(results):
        if not result.acceptable:
            raise BundleError(
                f"baking window {index} costs too much ({result}; allowed are {MAX_DROP} dB lost, "
                f"{MIN_LIKENESS} dB against exact where there is no capture, {MAX_BYTES:g} bytes): "
                "train with shorter windows, or use --force."
            )


def megabits_per_second(results: list[WindowResult]) -> float:
    """Mean data rate at which a page loads windows while the body plays."""
    size = sum(len(result.data) for result in results)
    return 8e-6 * size / sum(result.seconds for result in results)


def write(
    out: Path,
    parts: BodyParts,
    capture: Capture | None,
    about: About,
) -> Manifest:
    """Adds thumbnail, camera and background to a baked body, and writes the bundle.

    Args:
        out: The file to write.
        parts: The baked body.
        capture: The body's recording, for camera and background; None where it is not at hand.
        about: What else the bundle tells.

    Raises:
        BundleError: If the bundle fails a check.
    """
    info = parts.entry
    camera = standing_camera(np.array(info.low), np.array(info.high), capture)
    background = staging.background_colour(capture, 0) if capture else staging.NEUTRAL
    files = dict(parts.files)
    first = parts.baked.window_gaussians(0, 0.0)
    files[THUMBNAIL] = staging.thumbnail(first, camera, background)
    if about.notices:
        files[LICENSES] = about.notices.encode()
    manifest = Manifest(
        name=about.name,
        head=None,
        **parts.entries,
        speech=None,
        camera=camera,
        background=background,
        persona=about.persona,
        loss=parts.loss,
        provenance=about.provenance,
    )
    return write_bundle(out, *coarse_first(manifest, files))


def strip(body: MovingBody, baked: BakedBody, capture: Capture | None) -> np.ndarray:
    """A picture that compares exact and baked windows, one row for each view.

    Returns:
        (rows·H, 3·W, 3) uint8: recorded | exact | baked; (rows·H, 2·W, 3) without a capture.
    """
    lines = []
    count = max(1, _STRIP_ROWS // len(body.windows))
    for index, span in enumerate(body.windows):
        at = partial(baked.window_gaussians, index)
        probes = probe_views(ring_of_cameras(*seen_box(at)), span, count)
        views = recorded_views(capture, span, count) if capture else probes
        pair = window_pair(body, index, at, None)
        lines += [comparison_line(*pair, view) for view in views]
    return head_cost.stacked(lines)


def _fitting(largest: int) -> tuple[Shape, ...]:
    """The first of `SHAPES` in which windows of so many Gaussians, mixed anyhow, make a bundle."""
    fitting = ()
    for count in range(1, len(SHAPES) + 1):
        layers = 1 + sum(map(max, zip(*(shape.ranks for shape in SHAPES[:count]), strict=True)))
        if largest * layers <= MAX_MOVED:
            fitting = SHAPES[:count]
    if not fitting:
        most = MAX_MOVED // (1 + sum(SHAPES[0].ranks))
        raise BundleError(
            f"a window has {largest} Gaussians, more than browsers can move ({most}): train with "
            "fewer (--density.max-gaussians)."
        )
    return fitting


def _attempts(
    body: MovingBody,
    index: int,
    capture: Capture | None,
    head: HeadAt | None,
    shapes: Sequence[Shape],
) -> Iterator[WindowResult]:
    """Bakes and measures a window in each of the shapes, one after the other."""
    span, baker = body.windows[index], WindowBaker(body, index)
    seconds = (span.last - span.first) / body.fps
    for shape in shapes:
        baked = baker.baked(shape)
        recorded = recorded_views(capture, span) if capture else []
        probes = probe_views(ring_of_cameras(*seen_box(partial(window_gaussians, baked))), span)
        loss = measure_window(body, index, baked, recorded, probes, head)
        yield WindowResult(baked, baked.to_bytes(window_file(index)), seconds, loss)


def _best(attempts: Iterator[WindowResult]) -> WindowResult:
    """The first good result; else, of those within `MAX_BYTES` (or all), that nearest to exact."""
    tried = []
    for result in attempts:
        if result.good:
            return result
        tried.append(result)
    within = [result for result in tried if result.bytes_per_gaussian <= MAX_BYTES]
    return max(within or tried, key=lambda result: result.loss.psnr_baked_vs_exact or 0.0)


def body_info(windows: list[BakedWindow], body: MovingBody) -> BodyInfo:
    """The manifest's entry about a body of windows."""
    boxes = [seen_box(partial(window_gaussians, window), (0.0, 0.5, 1.0)) for window in windows]
    infos = [
        WindowInfo(
            first=span.first,
            last=span.last,
            num_gaussians=window.num_gaussians,
            num_clusters=window.num_clusters,
            ranks=window.ranks,
            file=window_file(i),
        )
        for i, (span, window) in enumerate(zip(body.windows, windows, strict=True))
    ]
    low = np.min([low for low, _ in boxes], axis=0)
    high = np.max([high for _, high in boxes], axis=0)
    return BodyInfo(
        body.fps, SAMPLES_PER_FRAME, staging.triple(low), staging.triple(high), tuple(infos)
    )


def seen_box(at: At, taus: Sequence[float] = (0.5,)) -> tuple[np.ndarray, np.ndarray]:
    """Bounding box of the visible Gaussians at some times, without a hundredth of strays.

    Args:
        at: Returns the Gaussians at τ.
        taus: Times in [0, 1].

    Returns:
        (3,) least and (3,) greatest coordinates.
    """
    points = []
    for gaussians in map(at, taus):
        seen = gaussians.opacities > _VISIBLE
        points.append(gaussians.means[seen if seen.any() else slice(None)].cpu().numpy())
    low, high = np.percentile(np.concatenate(points), (0.5, 99.5), axis=0)
    return low, high


def standing_camera(
    low: np.ndarray, high: np.ndarray, capture: Capture | None, front: np.ndarray | None = None
) -> CameraInfo:
    """A camera level with the body's middle, so far away that all of the body is in view.

    Args:
        low: (3,) least coordinates of the body's bounding box, metres.
        high: (3,) greatest coordinates of that box.
        capture: The body's recording; the mean upward direction of its cameras is up. Without a
            capture +y is up.
        front: (3,) direction in which the person looks, of any length; by default toward the
            capture's first camera, without a capture along +z.
    """
    up, toward = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    if capture is not None:
        rotations = np.stack([camera.world_to_camera[:3, :3] for camera in capture.cameras])
        up = -rotations[:, 1].mean(axis=0)
        up /= np.linalg.norm(up)
        toward = capture.cameras[0].camera_to_world[:3, 3] - (low + high) / 2
    if front is not None:
        toward = front
    toward = toward - up * (toward @ up)
    return staging.standing_view(low, high, up, toward / np.linalg.norm(toward))


def _mean_loss(losses: list[Loss]) -> Loss:
    """Mean of each value over the windows; None for a value that one window lacks."""
    columns = {}
    for name in ("psnr_exact", "psnr_baked", "psnr_baked_vs_exact"):
        values = [getattr(loss, name) for loss in losses]
        columns[name] = None if None in values else round(float(np.mean(values)), 4)
    return Loss(**columns)
