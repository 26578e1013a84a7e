"""Measures how much moves from frame to frame, and where, by optical flow in a clip's pictures."""

import contextlib
import hashlib
import json
import logging
import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ico3d.body.planning.flow_methods import FlowMethod, best_method, opencv
from ico3d.body.planning.windows import Window
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.capture.surface.coverage import HIDING, visible
from ico3d.capture.surface.hull import focus
from ico3d.common.camera import Camera
from ico3d.common.files import read_small, resolved, write_atomic, write_one_of_many
from ico3d.common.unpacking.npz import WIDTH, read_npz
from ico3d.errors import CaptureError, ModelError
from ico3d.splat.initial import in_pictures, spacing
from ico3d.training.log import progress_bar

if TYPE_CHECKING:
    import torch

HEIGHT = 320
"""Height in rows to which larger pictures are scaled down before flow is estimated."""
MOST_CAMERAS = 16
"""Most cameras whose pictures are used, evenly spread by azimuth; more would tell nothing new."""
MOVING = 1.0
"""Flow in centimetres per step above which a pixel counts as moving."""
DYNAMIC_SHARES = 0.3, 0.7
"""Shares of views in which a point moves, up to and from which it is fully still or dynamic."""
PERSON = 200.0
"""Assumed height of a picture in centimetres, where cameras do not tell the distance."""
VERSION = 1
"""Version of cached results, to be counted up when the measurement changes."""

CACHED, MOST_CACHED = re.compile(r"[0-9a-f]{24}\.npz"), 1 << 24
"""Names of cached files, and bytes of the largest that is copied."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class CameraFlow:
    """What moved in the pictures of one camera, in S steps from frame to frame.

    Attributes:
        index: Index of the camera in the capture.
        camera: The camera, scaled to the size of the pictures in which flow was estimated.
        energy: (S,) Σ_mask |f|² / Σ mask of each step, cm²; NaN where a picture is missing or
            shows nobody.
        moving: (S, H, ⌈W/8⌉) uint8, packed bits: foreground pixels that move in each step.
    """

    index: int
    camera: Camera
    energy: np.ndarray
    moving: np.ndarray


@dataclass(frozen=True)
class ClipFlow:
    """What moved in a span of a clip.

    Attributes:
        span: The frames that were measured; step i goes from frame span.first + i to the next.
        method: Name of the flow method.
        cameras: What moved in the pictures of each camera.
    """

    span: Window
    method: str
    cameras: tuple[CameraFlow, ...]

    @property
    def motion(self) -> np.ndarray:
        """(S,) cm²: m_i = mean over cameras of Σ_mask |f_i|² / Σ mask.

        f_i is the flow of a foreground pixel of frame i towards frame i + 1, measured in
        centimetres at the distance of what the cameras look at, so that a threshold means the
        same at any resolution and framing. Steps that no camera saw are interpolated.
        """
        energy = np.stack([flow.energy for flow in self.cameras])  # (C, S)
        known = np.isfinite(energy)
        seen = np.flatnonzero(known.any(0))
        if len(seen) == 0:
            return np.zeros(energy.shape[1])
        mean = np.nansum(energy[:, seen], 0) / known[:, seen].sum(0)  # (S',) of the seen steps
        return np.interp(np.arange(energy.shape[1]), seen, mean)

    def moving(self, flow: CameraFlow, window: Window) -> np.ndarray:
        """(H, W) bool: a camera's pixels in which the person moves in any step of a window."""
        steps = slice(window.first - self.span.first, max(window.last - self.span.first, 0))
        packed = np.bitwise_or.reduce(flow.moving[steps], axis=0)  # (H, ⌈W/8⌉)
        return np.unpackbits(packed, axis=1, count=flow.camera.width).astype(bool)


def clip_flow(
    capture: Capture,
    folder: Path | None = None,
    span: Window | None = None,
    method: FlowMethod | None = None,
    device: "torch.device | str" = "cpu",
) -> ClipFlow:
    """Measures what moves, in the pictures of up to 16 training cameras.

    Args:
        capture: The recording; where it has no masks, all pixels count.
        folder: Folder in which results are cached, one file per camera; None for no cache.
        span: Frames to measure; the whole clip by default.
        method: Flow method; by default the best one that is installed.
        device: Where the default method computes, if it can.

    Raises:
        CaptureError: If no camera shows the person in two successive frames.
        MissingExtraError: If no flow method is installed.
    """
    span = span or Window(0, capture.num_frames - 1)
    method = method or best_method(device)
    indices = _spread(capture)
    middle = focus([capture.cameras[index] for index in train_cameras(capture)])
    flows = []
    with progress_bar() as bar:
        steps = len(indices) * (len(span) - 1)
        task = bar.add_task("motion", total=steps, numbers=f"{method.name}, {len(indices)} cameras")
        for index in indices:
            size = _centimetres(capture.cameras[index], middle)
            work = _Work(capture, index, span, method, size, lambda: bar.advance(task))
            flows.append(_cached(work, folder))
            bar.update(task, completed=len(flows) * (len(span) - 1))
    if len(span) > 1 and all(np.isnan(flow.energy).all() for flow in flows):
        raise CaptureError(
            f"{capture.path}: no camera shows the person in two frames on end: motion cannot be "
            "measured."
        )
    return ClipFlow(span, method.name, tuple(flows))


def copy_cache(source: Path, target: Path) -> None:
    """Copies measured flow to where another training of the same clip looks for it.

    Either folder may have been begun by somebody else: of regular files that are named as the
    cache's and no larger than `MOST_CACHED`, the newest are copied, as many as one clip has, and no
    link is followed.

    Raises:
        ModelError: If the target is a link.
    """
    if os.path.islink(target):
        raise ModelError(f"{target} is a link: what is measured would be written elsewhere.")
    if os.path.islink(source):
        return
    cached = [file for file in source.glob("*.npz") if CACHED.fullmatch(file.name)]
    newest = sorted(cached, key=lambda file: file.lstat().st_mtime_ns)[-MOST_CAMERAS:]
    for file in newest:
        if not os.path.exists(target / file.name):
            with contextlib.suppress(OSError):  # no file of ours: it is measured again
                write_atomic(target / file.name, read_small(file, links=False, most=MOST_CACHED))


def dynamic_weights(
    points: np.ndarray, capture: Capture, window: Window, flow: ClipFlow | None = None
) -> np.ndarray:
    """How much surface points move within a window; initial values of α of the tunable MLP.

    A point is dynamic if, in enough of the views in which nothing hides it, it lies on a pixel of
    the person that moves in any step of the window.

    Args:
        points: (P, 3) metres, in the world, on the surface at the window's centre frame.
        capture: The recording.
        window: The window's frames.
        flow: Measured motion of the clip; by default that of the window's frames is measured.

    Returns:
        (P,) float64: 0 still, 1 dynamic, in between where views disagree; 0 where no view sees the
        point.
    """
    flow = flow or clip_flow(capture, span=window)
    gap = HIDING * float(np.quantile(spacing(points), 0.9))
    seen, moved = np.zeros(len(points)), np.zeros(len(points))
    for one in flow.cameras:
        inside = in_pictures(points, [one.camera])[0] & visible(points, one.camera, gap)  # (P,)
        column, row = one.camera.project(points[inside])[0].astype(int).T
        seen[inside] += 1
        moved[inside] += flow.moving(one, window)[row, column]
    still, dynamic = DYNAMIC_SHARES
    return np.clip((moved / np.maximum(seen, 1) - still) / (dynamic - still), 0, 1)


def _spread(capture: Capture) -> list[int]:
    """Indices of up to `MOST_CAMERAS` training cameras, evenly spread by azimuth."""
    indices = np.array(train_cameras(capture))
    centers = np.stack([capture.cameras[index].camera_to_world[:3, 3] for index in indices])
    across = centers - centers.mean(0)  # (C, 3)
    ring = indices[np.argsort(np.arctan2(across[:, 0], across[:, 2]), kind="stable")]
    places = np.linspace(0, len(ring), min(MOST_CAMERAS, len(ring)), endpoint=False)
    return sorted(ring[places.astype(int)].tolist())


def _centimetres(camera: Camera, middle: np.ndarray | None) -> float:
    """Size in centimetres of a pixel at the point (3,) that all cameras look at.

    Where there is no such point, or it is behind the camera, `PERSON` gives the size.
    """
    depth = 0.0 if middle is None else float(camera.project(middle)[1])
    return 100 * depth / float(camera.intrinsics[1, 1]) if depth > 0 else PERSON / camera.height


@dataclass(frozen=True)
class _Work:
    """The measurement of one camera's pictures.

    Attributes:
        capture: The recording.
        index: Index of the camera.
        span: Frames to measure.
        method: Flow method.
        pixel: Size of a pixel of the recorded picture in centimetres.
        advance: Called after each step, to show progress.
    """

    capture: Capture
    index: int
    span: Window
    method: FlowMethod
    pixel: float
    advance: Callable[[], None]

    @property
    def camera(self) -> Camera:
        """The camera, scaled to the size of the pictures in which flow is estimated."""
        camera = self.capture.cameras[self.index]
        scale = min(1.0, HEIGHT / camera.height)
        return camera.resized(max(1, round(scale * camera.width)), round(scale * camera.height))

    @property
    def steps(self) -> int:
        """S, the number of steps from frame to frame."""
        return len(self.span) - 1

    @property
    def packed(self) -> tuple[int, int]:
        """(h, ⌈w/8⌉), the shape of a picture's packed pixels."""
        return self.camera.height, -(-self.camera.width // 8)

    def picture(self, frame: int) -> tuple[np.ndarray, np.ndarray] | None:
        """The person before black (h, w, 3) uint8, and the person's mask (h, w) bool.

        None where the frame has no picture.
        """
        image = self.capture.image(self.index, frame)
        if image is None:
            return None
        mask = self.capture.mask(self.index, frame)
        mask = np.ones(image.shape[:2], np.float32) if mask is None else mask
        cut = np.concatenate([image * mask[..., None], mask[..., None]], -1)  # (H, W, 4)
        size, area = (self.camera.width, self.camera.height), opencv().INTER_AREA
        small = opencv().resize(np.ascontiguousarray(cut, np.float32), size, interpolation=area)
        return (small[..., :3] * 255 + 0.5).astype(np.uint8), small[..., 3] > 0.5

    def key(self) -> str:
        """A hash of all that the result depends on; of the pictures, three stand for all."""
        camera, frames = self.camera, {self.span.first, self.span.center, self.span.last}
        digest = hashlib.sha256()
        about = [VERSION, self.method.name, HEIGHT, MOVING, self.pixel, camera.width, camera.height]
        span = [self.index, self.span.first, self.span.last]
        digest.update(json.dumps([*about, *span, str(resolved(self.capture.path))]).encode())
        digest.update(camera.intrinsics.tobytes() + camera.world_to_camera.tobytes())
        for frame in sorted(frames):
            for part in self.picture(frame) or ():
                digest.update(part.tobytes())
        return digest.hexdigest()[:24]

    def measure(self) -> tuple[np.ndarray, np.ndarray]:
        """Energy (S,) and packed moving pixels (S, h, ⌈w/8⌉) of all steps."""
        camera, steps = self.camera, self.steps
        pixel = self.pixel * self.capture.cameras[self.index].height / camera.height
        energy = np.full(steps, np.nan)
        moving = np.zeros((steps, *self.packed), np.uint8)
        before = self.picture(self.span.first)
        for step in range(steps):
            after = self.picture(self.span.first + step + 1)
            if before is not None and after is not None and before[1].any():
                flow = pixel * self.method(before[0], after[0])  # (h, w, 2) centimetres
                squared = np.where(before[1], (flow.astype(np.float64) ** 2).sum(-1), 0)  # (h, w)
                energy[step] = squared.sum() / before[1].sum()
                moving[step] = np.packbits(squared > MOVING**2, axis=1)
            before = after
            self.advance()
        return energy, moving


def _cached(work: _Work, folder: Path | None) -> CameraFlow:
    """What moved in a camera's pictures, from the cache in a folder where it is there."""
    if folder is None:
        return CameraFlow(work.index, work.camera, *work.measure())
    file = folder / f"{work.key()}.npz"
    known = _load(file, work.steps * (1 + math.prod(work.packed)))
    if known is None:
        known = work.measure()
        energy, moving = known
        write_one_of_many(file, lambda to: np.savez_compressed(to, energy=energy, moving=moving))
    return CameraFlow(work.index, work.camera, *known)


def _load(file: Path, most: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Energy and moving pixels in a cached file; None where it is missing or damaged.

    It is damaged, too, if these are more than `most` numbers.
    """
    try:
        arrays = read_npz(file, WIDTH * most, ("energy", "moving"))
        return arrays["energy"], arrays["moving"]
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        logger.warning("%s is damaged; motion is measured again.", file)
        return None
