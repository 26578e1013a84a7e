"""Finds parts of a person that masks show but surface points miss, and points for them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from ico3d.capture.surface.hull import Silhouette, looked_at, visual_hull
from ico3d.common.camera import Camera

WORTH_FILLING = 0.03
"""Least missing share of the person; less is stray hair or edges of masks."""
VOXELS = 32
"""Voxels of a hull along half the width of the space that the pictures show."""
HIDING = 3.0
"""Depth behind other points at which a point counts as hidden, in spacings of the points.

For a hull the spacing is a voxel's edge. The value exceeds the widest hole that random points
leave.
"""
MOSTLY = 0.5
"""Share of the moments in which a camera must show the person at a place.

Shoulders move relative to a head that turns, and some masks are wrong.
"""
HELD = 0.5
"""Share of the cameras that must show a place; few cameras alone may agree on background."""
MISSING = 0.5
"""Share of the pictures of a place in which no surface point may be near."""

Moment = Mapping[int, Silhouette]
"""Silhouettes of the person at about the same time, by number of the camera."""


@dataclass(frozen=True)
class Gap:
    """Parts of a person that surface points miss.

    Attributes:
        points: (Q, 3) points on the missing parts, metres; Q may be 0.
        share: Share of the person's pixels that is missing, 0 to 1.
    """

    points: np.ndarray
    share: float


def find_gap(points: np.ndarray, moments: Sequence[Moment], reach: float) -> Gap:
    """Finds places where masks show the person but no surface point projects.

    Points come from the visual hulls of the moments, at places on which each camera agrees in most
    moments. A picture says nothing about places outside of it, so a person whom the pictures cut
    off continues as far as they reach. A camera whose masks contradict all others in most moments
    is ignored.

    Args:
        points: (P, 3) known surface points, metres.
        moments: Silhouettes at some moments, in the space of the points.
        reach: Distance from a point within which the point covers the surface, metres.

    Returns:
        The gap; empty, with share 0, if the points cover nearly all of the person.
    """
    views = [
        _View.of(camera, seen, points, reach)
        for moment in moments
        for camera, seen in moment.items()
    ]
    shares = [view.share for view in views if view.share is not None]
    share = float(np.median(shares)) if shares else 0.0
    if share < WORTH_FILLING:
        return Gap(np.empty((0, 3)), 0.0)
    found = [facing for moment in moments if (facing := _facing_surface(moment)) is not None]
    surface = np.concatenate([np.empty((0, 3)), *(facing.points for facing in found)])  # (S, 3)
    contradicted = [camera for facing in found for camera in facing.ignored]
    heard = [v for v in views if contradicted.count(v.number) <= len(found) / 2]
    kept = surface[_agreed(surface, heard)]
    return Gap(_thinned(kept, max((facing.edge for facing in found), default=1.0)), share)


def visible(points: np.ndarray, camera: Camera, gap: float) -> np.ndarray:
    """(P,) bool: surface points (P, 3) that no other point hides from a camera.

    The points themselves form a z-buffer with cells of size `gap` at their depth; a point is hidden
    if another one in its cell is nearer by more than `gap` metres.
    """
    pixels, depths = camera.project(points)  # (P, 2), (P,)
    cell = gap * camera.intrinsics[0, 0] / max(float(np.median(depths)), gap)
    inside = (depths > 0) & np.isfinite(pixels).all(1)
    column, row = np.floor(pixels[inside] / cell).T
    # Pairs of numbers as complex ones: those are sorted far faster than rows of an array.
    _, cells = np.unique(column + 1j * row, return_inverse=True)
    nearest = np.full(cells.max(initial=-1) + 1, np.inf)
    np.minimum.at(nearest, cells, depths[inside])
    found = np.zeros(len(points), bool)
    found[inside] = depths[inside] <= nearest[cells] + gap
    return found


@dataclass(frozen=True)
class _View:
    """A silhouette, and what of it no point accounts for.

    Attributes:
        number: The camera's.
        seen: The silhouette.
        bare: (H, W) bool the person's pixels without a point in reach.
    """

    number: int
    seen: Silhouette
    bare: np.ndarray

    @classmethod
    def of(cls, number: int, seen: Silhouette, points: np.ndarray, reach: float) -> "_View":
        """Projects points (P, 3) that account for `reach` metres around them."""
        rows, columns, depths, _ = _pixels(points, seen)
        empty = np.ones(seen.mask.shape, bool)
        empty[rows, columns] = False
        if empty.all():
            return cls(number, seen, seen.mask)
        near = reach * float(seen.camera.intrinsics[0, 0]) / float(np.median(depths))
        far = np.asarray(distance_transform_edt(empty)) > near
        return cls(number, seen, seen.mask & far)

    @property
    def share(self) -> float | None:
        """Of the person; None where the mask shows nobody."""
        return float(self.bare.sum() / self.seen.mask.sum()) if self.seen.mask.any() else None


def _pixels(
    points: np.ndarray, seen: Silhouette
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where a picture holds points (P, 3): rows, columns, depths (K,), and which (P,) bool."""
    pixels, depths = seen.camera.project(points)  # (P, 2), (P,)
    height, width = seen.mask.shape
    inside = (depths > 0) & ((pixels >= 0) & (pixels < (width, height))).all(1)
    columns, rows = pixels[inside].astype(int).T
    return rows, columns, depths[inside], inside


@dataclass(frozen=True)
class _Facing:
    """What the cameras of a moment see of its visual hull.

    Attributes:
        points: (S, 3).
        edge: Edge of the hull's voxels, metres.
        ignored: Numbers of the cameras whose masks contradict all others.
    """

    points: np.ndarray
    edge: float
    ignored: tuple[int, ...]


def _facing_surface(moment: Moment) -> _Facing | None:
    """The hull of a moment as far as it faces cameras; None where the masks make no hull."""
    numbers, seen = list(moment), list(moment.values())
    cameras = [silhouette.camera for silhouette in seen]
    box = looked_at(cameras) if len(cameras) > 1 else None
    if box is None:
        return None
    edge = box[1] / VOXELS
    hull = visual_hull(seen, edge)
    if hull is None or not len(hull.surface):
        return None
    facing = np.any([visible(hull.surface, camera, HIDING * edge) for camera in cameras], axis=0)
    return _Facing(hull.surface[facing], edge, tuple(numbers[index] for index in hull.ignored))


def _agreed(points: np.ndarray, views: Iterable[_View]) -> np.ndarray:
    """(S,) bool: which points (S, 3) most cameras hold, all of these show, and no others lie at."""
    tallies: dict[int, np.ndarray] = {}
    for view in views:
        rows, columns, _, inside = _pixels(points, view.seen)
        tally = tallies.setdefault(view.number, np.zeros((3, len(points))))
        tally[0, inside] += 1
        tally[1, inside] += view.seen.mask[rows, columns]
        tally[2, inside] += view.bare[rows, columns]
    each = np.reshape([*tallies.values()], (len(tallies), 3, len(points)))  # (C, 3, S)
    held = (each[:, 0] > 0).mean(0) > HELD  # (S,)
    shown = (each[:, 1] >= MOSTLY * each[:, 0]).all(0)  # (S,)
    _, person, bare = each.sum(0)  # (S,) each
    return held & shown & (bare >= MISSING * np.maximum(person, 1))


def _thinned(points: np.ndarray, edge: float) -> np.ndarray:
    """One of the points (S, 3) in each cube with this edge."""
    return points[np.unique(np.floor(points / edge), axis=0, return_index=True)[1]]
