"""Finds the eyeballs of a baked head, so that a page can turn its eyes (docs/bundle.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import Delaunay

from ico3d.avatar.staging import triple
from ico3d.bundle.evaluate import attributes, centres
from ico3d.bundle.head import BakedHead
from ico3d.bundle.manifest import GazeInfo
from ico3d.common.expression import EYE_UNIT, MOST_DISPLACEMENTS
from ico3d.common.spread import spread

LIDS = (slice(36, 42), slice(42, 48))
"""Landmarks of both eyes, in the order of Multi-PIE's 68 points."""
MOST_TURN = (0.21, 0.12)
"""Radians by which eyes may turn to either side, and up or down.

Beyond, what lids have always covered would be seen: no recording shows it.
"""
RADIUS = 0.0125
"""Metres of a ball. Those of adults differ by half a millimetre, those of children are little
smaller; too large a ball is found as much farther back, with its surface at the same place."""


def _grid(*spans: tuple[float, float, float]) -> np.ndarray:
    """(C, 3) metres, from three spans in millimetres: first, last, and step."""
    axes = [np.arange(first, last + step / 2, step) / 1000 for first, last, step in spans]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


SOUGHT = _grid((-2.5, 2.5, 0.5), (-2, 3.5, 0.5), (-16, -6, 0.5))
"""Where a ball's centre may lie, from the middle of the lids' landmarks, x, y and z."""
NEARER = _grid((-0.4, 0.4, 0.1), (-0.4, 0.4, 0.2), (-0.4, 0.4, 0.1))
"""Where it may lie, from the best place of `SOUGHT`."""
THICK = 0.0005
"""Metres within which Gaussians of the surface lie about it."""
FEWEST, ROUND = 12, 0.3
"""Fewest Gaussians of which an eye must be made, of fewer a turned eye has holes; and the least
share of what is seen between the lids that must lie on a ball."""
FARTHEST, NARROWEST = 0.9, 0.002
"""Metres from the origin of canonical head space where landmarks of an eye lie at most; and how far
those of an eye that is open spread at least, up and down."""
FAINT, MOST, BLOCK = 0.02, 1000, 256
"""Opacity of what is not seen; Gaussians between the lids, of some hundred usually, and places at
once that are looked at: whose head it is decides on the memory that this takes."""
INSIDE, OUTSIDE, AROUND = 0.0045, 0.0007, 0.0025
"""Metres under and over the ball's surface, and beside the opened lids, where an eye's own
Gaussians lie: an iris is under the cornea, and lids lie over the ball."""


@dataclass(frozen=True)
class Eyeball:
    """An eye's ball in canonical head space.

    Attributes:
        centre: (3,) metres.
        own: (N,) bool, the head's Gaussians that turn with it.
    """

    centre: np.ndarray
    own: np.ndarray


def with_turning_eyes(
    head: BakedHead, idle: np.ndarray, landmarks: np.ndarray | None
) -> tuple[BakedHead, GazeInfo | None]:
    """Adds two displacements that turn both eyes, if they are found.

    Args:
        head: The baked head, in the space of the bundle.
        idle: (B,) expression at rest, with open eyes.
        landmarks: (68, 3) Multi-PIE landmarks in the same space, metres; None where nobody knows
            them.

    Returns:
        The head, and what its manifest tells of it; the head as it is, and None, where eyes are
        no balls that lids leave free, as where depth is known badly.
    """
    balls = eyeballs_of(head, idle, landmarks)
    return turned_by_gaze(head, balls) if balls else (head, None)


def eyeballs_of(head: BakedHead, idle: np.ndarray, landmarks: np.ndarray | None) -> list[Eyeball]:
    """The balls of both eyes; none where one is not found. Arguments as of `with_turning_eyes`."""
    if landmarks is None or head.num_displacements + 2 > MOST_DISPLACEMENTS:
        return []
    found = [eyeball(head, idle, landmarks[lids]) for lids in LIDS]
    balls = [ball for ball in found if ball is not None]
    return balls if len(balls) == len(found) else []


def turned_by_gaze(head: BakedHead, balls: Sequence[Eyeball]) -> tuple[BakedHead, GazeInfo]:
    """Adds two displacements that turn a head's eyes, and says what its manifest tells of them."""
    turns = np.zeros((2, head.num_gaussians, 3))  # metres per radian
    for ball in balls:
        arm = head.means[ball.own].astype(np.float64) - ball.centre  # (n, 3)
        for turn, axis in zip(turns, ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]), strict=True):
            turn[ball.own] = np.cross(axis, arm)
    point = np.mean([ball.centre for ball in balls], axis=0)
    return _with_displacements(head, turns), GazeInfo(triple(point), MOST_TURN)


def with_still_eyes(head: BakedHead) -> BakedHead:
    """The head without the two displacements that `with_turning_eyes` adds."""
    return replace(
        head,
        displacement_basis=head.displacement_basis[:-2],
        displacement_w2=head.displacement_w2[:, :-2],
        displacement_b2=head.displacement_b2[:-2],
    )


def eyeball(head: BakedHead, idle: np.ndarray, lids: np.ndarray) -> Eyeball | None:
    """The ball behind the lids of one eye; None where what is seen there is no ball.

    Args:
        head: The baked head.
        idle: (B,) expression at rest, with open eyes.
        lids: (6, 3) landmarks around the opened eye, metres.
    """
    if not _is_open(lids):
        return None
    places, opacities = centres(head, idle).astype(np.float64), attributes(head, idle)[1]
    near = np.abs(places[:, 2] - lids[:, 2].mean()) < RADIUS
    between = np.flatnonzero(near & _within(lids[:, :2], places) & (opacities > FAINT))  # (n,)
    if len(between) < FEWEST:
        return None
    looked = between[spread(len(between), MOST)]
    centre, share = _ball(places[looked], opacities[looked], lids.mean(axis=0))
    if share < ROUND:
        return None
    distance = np.linalg.norm(places - centre, axis=1)  # (N,)
    shell = (distance > RADIUS - INSIDE) & (distance < RADIUS + OUTSIDE)
    wide = _grown(lids[:, :2], AROUND)
    own = shell & (places[:, 2] > centre[2]) & _within(wide, places)
    return Eyeball(centre, own) if own.sum() >= FEWEST else None


def _ball(points: np.ndarray, weights: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, float]:
    """Where the ball lies on whose surface most of what is seen lies, by trying.

    Least squares would be led astray by lashes, and by the rims of lids.

    Args:
        points: (n, 3) metres.
        weights: (n,) opacities.
        middle: (3,) middle of the lids' landmarks, metres.

    Returns:
        The centre (3,), and the share of the weights near its surface.
    """
    for places in (SOUGHT, NEARER):
        tried = middle + places  # (C, 3)
        scores = np.concatenate([_scores(block, points, weights) for block in _blocks(tried)])
        middle = tried[scores.argmax()]
    return middle, float(scores.max() / weights.sum())


def _scores(tried: np.ndarray, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(C,) how much of the weights lies on the surface of a ball about each of (C, 3) centres."""
    off = np.linalg.norm(points[None] - tried[:, None], axis=2) - RADIUS  # (C, n)
    return np.exp(-((off / THICK) ** 2)) @ weights


def _blocks(tried: np.ndarray) -> list[np.ndarray]:
    """The places (C, 3) in pieces that take little memory each."""
    return np.array_split(tried, max(1, len(tried) // BLOCK))


def _is_open(lids: np.ndarray) -> bool:
    """Whether landmarks (6, 3) lie around an opening near the head, and not on a line."""
    if not (np.abs(lids) < FARTHEST).all():
        return False
    across = np.linalg.svd(lids[:, :2] - lids[:, :2].mean(axis=0), compute_uv=False)
    return bool(across[1] > NARROWEST)


def _within(outline: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(N,) bool, the places (N, 3) within the hull of an outline (n, 2), as seen along z."""
    return Delaunay(outline).find_simplex(places[:, :2]) >= 0


def _grown(outline: np.ndarray, by: float) -> np.ndarray:
    """An outline (n, 2) about its middle, each point farther away by so many metres."""
    arms = outline - outline.mean(axis=0)
    return outline + by * arms / np.linalg.norm(arms, axis=1, keepdims=True)


def _with_displacements(head: BakedHead, turns: np.ndarray) -> BakedHead:
    """The head with further displacements (M, N, 3), metres per radian, which no network moves."""
    values = np.round(turns / EYE_UNIT).astype(np.int8)
    none = np.zeros((head.displacement_w2.shape[0], len(turns)), np.float32)
    return replace(
        head,
        displacement_basis=np.concatenate([head.displacement_basis, values]),
        displacement_w2=np.concatenate([head.displacement_w2, none], axis=1),
        displacement_b2=np.concatenate([head.displacement_b2, none[0]]),
    )
