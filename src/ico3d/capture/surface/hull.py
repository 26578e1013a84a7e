"""Visual hulls (Laurentini 1994): volumes on which all masks agree, carved out of voxels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from PIL import Image
from scipy.ndimage import binary_dilation, label

from ico3d.common.camera import Camera
from ico3d.common.native.jit import njit
from ico3d.common.spread import spread

LARGEST_MASK = 512
"""Longer side in pixels to which masks are reduced; more would be finer than any voxel."""
MARGIN = 1.1
"""Size of the carved box as a factor of the width that the cameras' pictures show."""
MOST_PARALLEL = 1e4
"""Condition number above which viewing directions count as parallel (less than a degree apart)."""
WORTH_IGNORING = 0.01
"""A mask is bad if the hull without it fills this much more of the other masks."""
CAMERAS_PER_BAD, MOST_BAD = 16, 4
"""One mask in this many may be bad, up to so many; with four cameras or more, at least one."""
MOST_SEEN = 100
"""Silhouettes that are carved with, evenly chosen: more tell nothing new."""
HELD, SURELY_HELD = 0.5, 0.7
"""Shares of the pictures that must show a voxel, and one of the voxels connected to it."""
MOST_CELLS = 300
"""Voxels along each side of the box; where cameras show more space, voxels are larger."""
MOST_LOOKS = 24 * MOST_CELLS**3
"""Voxels of the box times pictures, beyond which voxels are larger, too."""
BISECTIONS = 4
"""Number of times that a voxel's edge is halved to locate the surface."""


@dataclass(frozen=True)
class Silhouette:
    """The person's outline as one camera saw it.

    Attributes:
        camera: The camera, with the size of the mask.
        mask: (H, W) bool, true on the person.
    """

    camera: Camera
    mask: np.ndarray

    @classmethod
    def of(cls, camera: Camera, mask: np.ndarray) -> "Silhouette":
        """The silhouette of a mask (H, W) in [0, 1]; large masks are reduced."""
        scale = min(1.0, LARGEST_MASK / max(mask.shape))
        height, width = (max(1, round(side * scale)) for side in mask.shape)
        picture = Image.fromarray(np.asarray(mask, np.float32))
        small = np.asarray(picture.resize((width, height), Image.Resampling.BOX))
        return cls(camera.resized(width, height), small > 0.5)


@dataclass(frozen=True)
class Hull:
    """A visual hull.

    Attributes:
        surface: (P, 3) points on the hull's surface, metres, about one per voxel face; P may be 0.
        ignored: Indices of silhouettes that contradict all others.
    """

    surface: np.ndarray
    ignored: tuple[int, ...]


def visual_hull(silhouettes: Sequence[Silhouette], edge: float) -> Hull | None:
    """Carves the box that the cameras look at by their silhouettes.

    A voxel belongs to the hull if no mask excludes it and at least half of the pictures, and at
    least two, show its place. A picture says nothing about places outside of it. Parts of the hull
    without any voxel that most pictures show are dropped; otherwise corners that only two opposite
    cameras see would appear.

    From good masks, a hull fills every mask when seen from that mask's camera. A few masks without
    which the hull fills the others clearly better are bad and ignored.

    Args:
        silhouettes: What cameras around the person saw at one moment.
        edge: Edge of a voxel in metres; the surface is located to a sixteenth of that. Cameras that
            show more space than a person fills get larger voxels.

    Returns:
        The hull; None if the cameras do not look at one place from different sides.
    """
    chosen = spread(len(silhouettes), MOST_SEEN)
    silhouettes = [silhouettes[index] for index in chosen]
    box = looked_at([s.camera for s in silhouettes]) if len(silhouettes) > 1 else None
    if box is None:
        return None
    center, radius = box
    most = min(MOST_CELLS, 2 * int((MOST_LOOKS / len(silhouettes)) ** (1 / 3) / 2))
    edge = max(edge, 2 * MARGIN * radius / most)
    cells = min(2 * math.ceil(MARGIN * radius / edge), most)
    origin = center - (cells - 1) / 2 * edge
    ignored = _bad(silhouettes, origin, edge, cells)
    stack = _Stack.of([s for index, s in enumerate(silhouettes) if index not in ignored])
    carved = _carve(origin, edge, cells, 0, *stack.arrays) == 0  # (cells, cells, cells)
    occupied = _connected(carved, _surely(carved, origin, edge, stack))
    return Hull(_surface(occupied, origin, edge, stack), tuple(chosen[index] for index in ignored))


def looked_at(cameras: Sequence[Camera]) -> tuple[np.ndarray, float] | None:
    """Centre (3,) of what the cameras look at, and the radius that their pictures show, metres.

    None if the cameras do not look at one place from different sides.
    """
    middle = focus(cameras)
    if middle is None:
        return None
    widths = [
        np.linalg.norm(middle - camera.camera_to_world[:3, 3])
        * max(camera.width / camera.intrinsics[0, 0], camera.height / camera.intrinsics[1, 1])
        for camera in cameras
    ]
    radius = float(np.median(widths)) / 2
    return (middle, radius) if math.isfinite(radius) else None


def focus(cameras: Sequence[Camera]) -> np.ndarray | None:
    """(3,) point nearest to the centre rays of all pictures; None if these are nearly parallel.

    The rays go through the centres of the pictures, because the optical axis of a cropped picture
    lies elsewhere.
    """
    poses = np.stack([camera.camera_to_world for camera in cameras])  # (C, 4, 4)
    middles = np.array([[c.width / 2, c.height / 2, 1.0] for c in cameras])  # (C, 3)
    inverses = np.linalg.inv(np.stack([camera.intrinsics for camera in cameras]))  # (C, 3, 3)
    axes = (poses[:, :3, :3] @ inverses @ middles[:, :, None])[:, :, 0]  # (C, 3)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    across = np.eye(3) - axes[:, :, None] * axes[:, None]  # (C, 3, 3)
    if not np.isfinite(across).all() or np.linalg.cond(across.sum(0)) > MOST_PARALLEL:
        return None
    return np.linalg.solve(across.sum(0), (across @ poses[:, :3, 3:]).sum(0))[:, 0]


@dataclass(frozen=True)
class _Stack:
    """Silhouettes as the kernels want them.

    Attributes:
        projections: (C, 3, 4) world to homogeneous pixels.
        masks: (C, H, W) bool, the largest size.
        sizes: (C, 2) height and width of each.
        held: Pictures that must hold a point of the hull.
        surely: Pictures that must hold one of those that it is connected to.
    """

    projections: np.ndarray
    masks: np.ndarray
    sizes: np.ndarray
    held: int
    surely: int

    @classmethod
    def of(cls, silhouettes: Sequence[Silhouette]) -> "_Stack":
        """Stacks them."""
        projections = [s.camera.intrinsics @ s.camera.world_to_camera[:3] for s in silhouettes]
        sizes = np.array([s.mask.shape for s in silhouettes])  # (C, 2)
        masks = np.zeros((len(silhouettes), *sizes.max(0)), bool)
        for into, silhouette in zip(masks, silhouettes, strict=True):
            height, width = silhouette.mask.shape
            into[:height, :width] = silhouette.mask
        held = (max(2, math.ceil(part * len(silhouettes))) for part in (HELD, SURELY_HELD))
        return cls(np.stack(projections), masks, sizes, *held)

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """The kernels' arguments."""
        return self.projections, self.masks, self.sizes, self.held


def _bad(
    silhouettes: Sequence[Silhouette], origin: np.ndarray, edge: float, cells: int
) -> tuple[int, ...]:
    """Numbers of the silhouettes that contradict all others, at half the resolution."""
    count = len(silhouettes)
    allowed = 0 if count < 4 else min(max(1, count // CAMERAS_PER_BAD), MOST_BAD)
    stack = _Stack.of(silhouettes)
    origin, edge = origin + edge / 2, 2 * edge
    voxels = np.argwhere(_carve(origin, edge, cells // 2, allowed, *stack.arrays) <= allowed)
    centers = origin + voxels * edge  # (V, 3)
    missed = _seen(centers, *stack.arrays[:3]) == 0  # (C, V)
    fillings = [_Filling(s, centers, edge) for s in silhouettes]
    ignored: list[int] = []
    while len(ignored) < allowed:
        left = [c for c in range(count) if c not in ignored]
        worst = sorted(left, key=lambda c: -missed[c].sum())[: 1 + allowed]
        kept = ~missed[left].any(0)  # (V,)
        gains = []
        for c in worst:
            others = [o for o in left if o != c]
            without = ~missed[others].any(0)
            gains.append(
                np.mean([fillings[o].share(without) - fillings[o].share(kept) for o in others])
            )
        if max(gains) < WORTH_IGNORING:
            break
        ignored.append(worst[int(np.argmax(gains))])
    return tuple(sorted(ignored))


class _Filling:
    """How much of a mask voxels fill, in cells as large as voxels are there."""

    def __init__(self, silhouette: Silhouette, centers: np.ndarray, edge: float):
        """Prepares for any choice among voxels with centres (V, 3)."""
        camera = silhouette.camera
        pixels, depths = camera.project(centers)  # (V, 2), (V,)
        self._front = depths > 0
        depth = float(np.median(depths[self._front])) if self._front.any() else 1.0
        wide = edge * float(camera.intrinsics[[0, 1], [0, 1]].max()) / depth
        side = max(1, math.ceil(min(wide, max(silhouette.mask.shape))))
        rows, columns = (-(-size // side) for size in silhouette.mask.shape)
        padded = np.zeros((rows * side, columns * side), bool)
        padded[: silhouette.mask.shape[0], : silhouette.mask.shape[1]] = silhouette.mask
        self._mask = padded.reshape(rows, side, columns, side).mean((1, 3)) > 0.5
        cells = np.floor(pixels / side)
        self._cells = np.clip(np.nan_to_num(cells), -1, (columns, rows)).astype(int) + 1  # (V, 2)

    def share(self, kept: np.ndarray) -> float:
        """The share of the mask that the chosen voxels (V,) bool lie behind, or next to that."""
        rows, columns = self._mask.shape
        filled = np.zeros((rows + 2, columns + 2), bool)
        column, row = self._cells[kept & self._front].T
        filled[row, column] = True
        near = binary_dilation(filled, np.ones((3, 3)))[1:-1, 1:-1]
        return float((near & self._mask).sum() / max(self._mask.sum(), 1))


def _surely(occupied: np.ndarray, origin: np.ndarray, edge: float, stack: _Stack) -> np.ndarray:
    """Those of the occupied voxels (n, n, n) bool that most pictures hold, (n, n, n) bool."""
    centers = origin + np.argwhere(occupied) * edge  # (V, 3)
    sure = np.zeros_like(occupied)
    sure[occupied] = _within(centers, *stack.arrays[:3], stack.surely)
    return sure


def _connected(occupied: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """The parts of occupied voxels (n, n, n) bool that hold a sure one."""
    parts, _ = label(occupied)  # type: ignore (its stub knows two kinds of answers)
    return occupied & np.isin(parts, np.unique(parts[sure]))


def _surface(occupied: np.ndarray, origin: np.ndarray, edge: float, stack: _Stack) -> np.ndarray:
    """(P, 3) where the hull ends between occupied voxels (n, n, n) and empty neighbours."""
    padded = np.pad(occupied, 1)
    inner, outer = [], []
    for axis, way in product(range(3), (-1, 1)):
        bare = padded & ~np.roll(padded, -way, axis)
        cell = np.argwhere(bare) - 1  # (F, 3)
        inner.append(origin + edge * cell)
        outer.append(inner[-1] + edge * way * np.eye(3)[axis])
    inside, outside = np.concatenate(inner), np.concatenate(outer)  # (P, 3) each
    for _ in range(BISECTIONS):
        middle = (inside + outside) / 2
        within = _within(middle, *stack.arrays)[:, None]  # (P, 1)
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return inside


@njit(cache=True, nogil=True)
def _look(x, y, z, c, projections, masks, sizes):
    """What a picture says of a point: 1 person, 0 background, -1 nothing."""
    # Elements of the whole arrays: a view of one picture's part takes longer than the rest.
    p = projections
    depth = p[c, 2, 0] * x + p[c, 2, 1] * y + p[c, 2, 2] * z + p[c, 2, 3]
    if depth <= 0.0:
        return -1
    column = p[c, 0, 0] * x + p[c, 0, 1] * y + p[c, 0, 2] * z + p[c, 0, 3]
    row = p[c, 1, 0] * x + p[c, 1, 1] * y + p[c, 1, 2] * z + p[c, 1, 3]
    column, row = column / depth, row / depth
    if not (0.0 <= column < sizes[c, 1] and 0.0 <= row < sizes[c, 0]):
        return -1
    return 1 if masks[c, int(row), int(column)] else 0


@njit(cache=True, nogil=True)
def _misses(x, y, z, allowed, projections, masks, sizes, held):
    """Masks that exclude a point; more than allowed also where too few pictures hold it."""
    count, missed = 0, 0
    for c in range(len(projections)):
        said = _look(x, y, z, c, projections, masks, sizes)
        count += said >= 0
        missed += said == 0
        if missed > allowed:
            return missed
    return missed if count >= held else allowed + 1


@njit(cache=True, nogil=True)
def _carve(origin, edge, cells, allowed, projections, masks, sizes, held):
    """(cells, cells, cells) int16 masks that exclude each voxel, counted up to allowed + 1."""
    missed = np.empty((cells, cells, cells), np.int16)
    for i in range(cells):
        for j in range(cells):
            for k in range(cells):
                x, y, z = origin[0] + i * edge, origin[1] + j * edge, origin[2] + k * edge
                missed[i, j, k] = _misses(x, y, z, allowed, projections, masks, sizes, held)
    return missed


@njit(cache=True, nogil=True)
def _within(points, projections, masks, sizes, held):
    """(P,) bool, whether no mask excludes points (P, 3)."""
    found = np.empty(len(points), np.bool_)
    for p in range(len(points)):
        x, y, z = points[p]
        found[p] = _misses(x, y, z, 0, projections, masks, sizes, held) == 0
    return found


@njit(cache=True, nogil=True)
def _seen(points, projections, masks, sizes):
    """(C, P) int8, what each picture says of points (P, 3)."""
    said = np.empty((len(projections), len(points)), np.int8)
    for c in range(len(projections)):
        for p in range(len(points)):
            x, y, z = points[p]
            said[c, p] = _look(x, y, z, c, projections, masks, sizes)
    return said
