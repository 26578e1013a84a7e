"""Generalised Procrustes analysis of landmarks without gaps: one rigid head for all frames."""

from dataclasses import dataclass

import numpy as np

ROUNDS = 20
STEADY, MOVING = 0.0015, 0.005
"""Usual deviations in metres of landmarks on bone, and of those that move with the expression."""
BELIEF = 20
"""Number of frames as much as which those usual deviations count."""


@dataclass(frozen=True)
class RigidHead:
    """A head that moves rigidly through F frames.

    Attributes:
        shape: (N, 3) landmarks of the head, metres.
        spreads: (N,) deviation of each landmark from the rigid shape, metres.
        poses: (F, 4, 4) from the shape's space to the world of the landmarks.
    """

    shape: np.ndarray
    spreads: np.ndarray
    poses: np.ndarray


def rigid_fit(source: np.ndarray, target: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Rigid motions with the least weighted sum of squared distances (Kabsch).

    Args:
        source: (N, 3) or (F, N, 3) points.
        target: (F, N, 3) points.
        weights: (N,) or (F, N), not negative.

    Returns:
        (F, 4, 4) from source to target.
    """
    return _fit(source, target, weights)[0]


def similarity_fit(source: np.ndarray, target: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Like `rigid_fit`, with a scale (Umeyama): the upper left 3×3 is scale · rotation."""
    poses, scales = _fit(source, target, weights)
    share = weights / weights.sum(-1, keepdims=True)
    middles = [np.einsum("...n,...nc->...c", share, points) for points in (source, target)]
    poses[:, :3, :3] *= scales[:, None, None]
    poses[:, :3, 3] = middles[1] - (poses[:, :3, :3] @ middles[0][..., None])[..., 0]
    return poses


def _fit(
    source: np.ndarray, target: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(F, 4, 4) rigid motions, and the (F,) scales that would bring the sizes together."""
    share = (weights / weights.sum(-1, keepdims=True))[..., None]  # (..., N, 1)
    from_middle, to_middle = (share * source).sum(-2), (share * target).sum(-2)
    here, there = source - from_middle[..., None, :], target - to_middle[..., None, :]
    spread = np.swapaxes(share * there, -1, -2) @ here  # (F, 3, 3)
    left, stretch, right = np.linalg.svd(spread)
    mirror = np.sign(np.linalg.det(left @ right))
    signs = np.stack([np.ones_like(mirror), np.ones_like(mirror), mirror], -1)  # (F, 3)
    turns = (left * signs[:, None]) @ right  # (F, 3, 3)
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3] = turns
    poses[:, :3, 3] = to_middle - (turns @ from_middle[..., None])[..., 0]
    return poses, (stretch * signs).sum(-1) / (share * here**2).sum((-1, -2))


def moved(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(F, N, 3): points (N, 3) or (F, N, 3), transformed by (F, 4, 4)."""
    return points @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]


def inverse(poses: np.ndarray) -> np.ndarray:
    """(F, 4, 4) inverses of rigid motions."""
    back = np.tile(np.eye(4), (len(poses), 1, 1))
    back[:, :3, :3] = poses[:, :3, :3].transpose(0, 2, 1)
    back[:, :3, 3] = -(back[:, :3, :3] @ poses[:, :3, 3:])[..., 0]
    return back


def rigid_head(points: np.ndarray, canonical: np.ndarray, steady: np.ndarray) -> RigidHead:
    """The rigid head behind landmarks of many frames, in the space of a canonical face.

    Mean shape and poses are computed in turn. Landmarks are weighted by their steadiness from frame
    to frame. The shape keeps its size; only position and orientation are those of the canonical
    face.

    Args:
        points: (F, N, 3) metres in the world.
        canonical: (N, 3) a face of roughly that shape, metres.
        steady: (N,) bool: landmarks that hardly move with the expression.
    """
    guess = np.where(steady, STEADY, MOVING)
    spreads, shape = guess, canonical
    poses = rigid_fit(shape, points, spreads**-2)
    for _ in range(ROUNDS):
        shape = moved(inverse(poses), points).mean(0)
        away = np.linalg.norm(moved(inverse(poses), points) - shape, axis=-1)  # (F, N)
        count = len(points)
        squares = (BELIEF * guess**2 + count * np.median(away, axis=0) ** 2) / (BELIEF + count)
        spreads = np.sqrt(squares)
        poses = rigid_fit(shape, points, spreads**-2)
    return _in_canonical_space(RigidHead(shape, spreads, poses), canonical, steady)


def _in_canonical_space(head: RigidHead, canonical: np.ndarray, steady: np.ndarray) -> RigidHead:
    """A head placed and turned like the canonical face that is scaled to its size."""
    place = similarity_fit(canonical, head.shape[None], steady.astype(float))[0]
    place[:3, :3] /= np.cbrt(np.linalg.det(place[:3, :3]))
    shape = moved(inverse(place[None]), head.shape)[0]
    return RigidHead(shape, head.spreads, head.poses @ place)
