"""Paths of strands on a head: long and loose, or short and falling away from the crown."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ico3d.studio.person.growing.skull import Skull

SHORT_POINTS = 8
"""Points of a strand of short hair."""
LOOSE_POINTS, LOOSE_LENGTH = 26, 0.27
"""Points of a strand of loose hair, and how far it hangs below the head, metres."""
OFF = 0.006
"""Least distance of loose hair from skin and clothes, metres."""
CROWN = np.array([0.0, 0.85, -0.5]) / np.hypot(0.85, 0.5)


@dataclass(frozen=True)
class Paths:
    """N strands of K points.

    Attributes:
        points: (N, K, 3) metres.
        depth: (N, K) 0 at the surface of the hair, 1 at the skin.
        taper: (N, K) factor of the thickness.
        tone: (N,) factor of the colour; None for strands that differ at random.
    """

    points: np.ndarray
    depth: np.ndarray
    taper: np.ndarray
    tone: np.ndarray | None = None


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def smooth(low: float, high: float, value: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, a smooth transition between."""
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def clumped(points: np.ndarray, share: float, guides: int, amount: float) -> np.ndarray:
    """Draws strands (N, K, 3) towards the nearest of some of them, the more the nearer the tip.

    Args:
        points: (N, K, 3) metres.
        share: Part of the strand from which on it is drawn.
        guides: Number of strands that draw others.
        amount: How near they come at the tip, 0 to 1.
    """
    guides = min(guides, len(points))
    _, nearest = KDTree(points[:guides, 0]).query(points[:, 0])
    t = np.linspace(0, 1, points.shape[1])
    weight = (amount * np.clip((t - share) / (1 - share), 0, 1))[None, :, None]
    return points + weight * (points[nearest] - points)


def waves(count: int, length: int, turns: float, random: np.random.Generator) -> np.ndarray:
    """(count, length, 3) smooth random displacements of about unit size, 0 at the root."""
    t = np.linspace(0, 1, length)[None, :, None]
    phase = random.uniform(0, 2 * np.pi, (count, 1, 3))
    speed = turns * random.uniform(0.6, 1.4, (count, 1, 3))
    swing = np.sin(2 * np.pi * speed * t + phase) + 0.5 * np.sin(4.4 * np.pi * speed * t - phase)
    return (swing - swing[:, :1]) * np.minimum(1, 3 * t)


def loose(
    skull: Skull,
    roots: np.ndarray,
    below: tuple[np.ndarray, np.ndarray],
    random: np.random.Generator,
) -> Paths:
    """Long hair, parted in the middle, that falls beside the face and behind the shoulders.

    Args:
        skull: The head.
        roots: (N, 3) places of the roots, metres.
        below: Places (M, 3) and normals (M, 3) of skin and clothes, on which it lies.
        random: Source of all random choices.
    """
    count, s = len(roots), skull.scale
    start = unit(roots - skull.centre)
    side = np.where(start[:, 0] + 0.02 * random.standard_normal(count) < 0, -1.0, 1.0)
    turn = np.abs(np.arctan2(start[:, 0], start[:, 2]))  # 0 in front, π behind
    aim = side * np.radians(82 + 98 * np.clip(turn / np.pi, 0, 1) ** 1.3)
    drop = np.radians(random.uniform(92, 102, count))  # from the crown, where the head ends
    end = np.stack(
        [np.sin(drop) * np.sin(aim), np.cos(drop), np.sin(drop) * np.cos(aim)], 1
    )  # (N, 3)
    over = LOOSE_POINTS // 2
    t = np.linspace(0, 1, over)
    angle = np.arccos(np.clip((start * end).sum(1), -1, 1))[:, None]  # (N, 1)
    sine = np.maximum(np.sin(angle), 1e-3)
    one, two = np.sin((1 - t) * angle) / sine, np.sin(t * angle) / sine  # (N, K)
    path = one[..., None] * start[:, None] + two[..., None] * end[:, None]
    bow = 0.35 * np.sin(np.pi * t) * smooth(-0.2, 0.7, start[:, 2])[:, None]
    path = unit(path + bow[..., None] * np.array([0.0, 0.6, 0.0]))
    level = random.random(count) ** 0.6  # 1: on the surface
    rise = 1 - np.exp(-6 * t)
    full = s * (0.004 + 0.010 * smooth(0.1, 0.9, t))
    head = skull.on(path, 0.0006 + rise * full * (0.2 + 0.8 * level[:, None]))
    falls = np.linspace(0, 1, LOOSE_POINTS - over + 1)[1:]  # (L,)
    long = s * LOOSE_LENGTH * random.uniform(0.8, 1.05, count)
    hang = np.repeat(head[:, -1:], len(falls), 1)
    hang[..., 1] -= long[:, None] * falls
    flare = unit(head[:, -1] * [1, 0, 1])
    hang += (0.012 * np.sin(np.pi * falls))[None, :, None] * flare[:, None]
    points = np.concatenate([head, hang], 1)  # (N, K + L, 3)
    for one in (side > 0, side < 0):  # locks of one side have nothing of the other
        points[one] = clumped(points[one], 0.35, 250, 0.55)
    points += 0.0016 * waves(count, LOOSE_POINTS, 1.0, random)
    points[:, over:] = _outside(points[:, over:], *below)
    along = np.linspace(0, 1, LOOSE_POINTS)
    depth = (1 - level)[:, None] * np.minimum(1, 4 * along)
    taper = np.broadcast_to(1 - 0.6 * along**4, depth.shape)
    return Paths(points, depth, taper)


def _outside(points: np.ndarray, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Points (N, K, 3), pushed out of a surface where they lie in it or closer than `OFF` to it.

    What lies beside the nearest place of the surface rather than behind it is left where it is.
    """
    flat = points.reshape(-1, 3).copy()
    tree = KDTree(places)
    for _ in range(3):
        nearest = tree.query(flat)[1]
        away, normal = flat - places[nearest], normals[nearest]
        height = (away * normal).sum(1)
        beside = np.linalg.norm(away - height[:, None] * normal, axis=1)
        behind = beside < 0.008 + 0.5 * np.abs(height)
        flat += (behind * np.maximum(OFF - height, 0))[:, None] * normal
    return flat.reshape(points.shape)


def short(skull: Skull, roots: np.ndarray, random: np.random.Generator) -> Paths:
    """Short hair: longer on top, swept forward and aside, cropped at the sides and in the neck."""
    count, s = len(roots), skull.scale
    start = unit(roots - skull.centre)
    top = smooth(0.25, 0.72, start[:, 1] + 0.12 * start[:, 2])  # (N,)
    length = s * (0.014 + 0.048 * top) * random.uniform(0.75, 1.15, count)
    level = random.random(count) ** 0.7
    highest = s * (0.005 + 0.017 * top) * (0.2 + 0.8 * level)
    lean = waves(count, SHORT_POINTS, 0.4, random)[:, -1, 0] * 0.25
    patch = np.sin(31 * start[:, 0] + 2.0) * np.sin(27 * start[:, 2] + 1.0)
    step = length / (SHORT_POINTS - 1)
    feet, foot = [start], start
    for k in range(1, SHORT_POINTS):
        away = unit(foot * (foot @ CROWN)[:, None] - CROWN)  # down from the crown
        aside = np.stack([np.ones(count), np.zeros(count), np.zeros(count)], 1)
        turned = np.cross(foot, away)
        flow = away + (0.75 * top * smooth(-0.2, 0.5, foot[:, 2]))[:, None] * aside
        flow += (lean + 0.30 * patch)[:, None] * turned
        flow = unit(flow - foot * (flow * foot).sum(1, keepdims=True))
        upright = 0.35 + 0.65 * k / SHORT_POINTS  # a strand first rises, then lies down
        foot = unit(foot + flow * (step * upright / skull.radius(foot))[:, None])
        feet.append(foot)
    path = np.stack(feet, axis=1)  # (N, K, 3)
    t = np.linspace(0, 1, SHORT_POINTS)
    arch = np.sin(np.pi * np.minimum(1, 0.62 * t + 0.0) ** 0.8)
    height = 0.0005 + highest[:, None] * arch
    points = skull.on(path, height)
    points = clumped(points, 0.1, 650, 0.6)
    points += 0.0006 * waves(count, SHORT_POINTS, 0.45, random)
    depth = (1 - level)[:, None] * np.clip(0.4 + 0.6 * (1 - t), 0, 1)
    taper = np.broadcast_to(1 - 0.8 * t**3, depth.shape)
    return Paths(points, depth, taper)
