"""Long hair that is combed back over the head and tied into a tail."""

import numpy as np
from scipy.spatial import KDTree

from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import Paths, clumped, smooth, unit, waves

POINTS = 18
"""Points of a strand from its root to where the hair is tied, and of one in the tail."""
MIDDLE, AWAY = 0.18, 0.45
"""How far from the middle of the head hair is combed aside, and how much, as shares of the head's
radius."""
LOCKS, FINE_LOCKS, TAIL_LOCKS = 170, 520, 60
"""Locks on a head, the smaller ones in them, and those of a tail."""


def locks(roots: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The lock (N,) of each root (N, 3), and how near it is to the lock's edge, 0 to 1."""
    away, nearest = KDTree(roots[:count]).query(roots, k=2)
    return nearest[:, 0], np.clip(away[:, 0] / np.maximum(away[:, 1], 1e-9), 0, 1) ** 3


def tied(skull: Skull, roots: np.ndarray, tie: np.ndarray, random: np.random.Generator) -> Paths:
    """Hair combed from roots (N, 3) over the head to where it is tied.

    Strands of a lock share their tone and the way they are combed, because the eye sees locks
    where it cannot see strands.
    """
    count, s = len(roots), skull.scale
    start, end = unit(roots - skull.centre), unit(tie - skull.centre)
    t = np.linspace(0, 1, POINTS)
    angle = np.arccos(np.clip(start @ end, -1, 1))[:, None]  # (N, 1)
    one, two = np.sin((1 - t) * angle), np.sin(t * angle)  # (N, K)
    path = unit(one[..., None] * start[:, None] + two[..., None] * end)
    side = np.tanh(start[:, 0] / MIDDLE)  # (N,) -1 on the right, 1 on the left
    lock, edge = locks(roots, LOCKS)
    fine, fine_edge = locks(roots, FINE_LOCKS)
    front = smooth(-0.2, 0.7, start[:, 2]) * smooth(0.0, 0.6, start[:, 1])  # (N,)
    combed = _drift(start) + 0.10 * random.standard_normal(LOCKS)[lock]
    sweep = np.stack([AWAY * side, -0.20 + 0.10 * combed, 0.12 + 0.06 * combed], 1)
    bow = np.sin(np.pi * t**0.85) * (1 - 0.35 * t)
    path = path + (front[:, None] * bow)[..., None] * sweep[:, None]
    # Beside and behind, locks cross the shortest way a little up or down.
    path[..., 1] += (0.045 * (1 - front) * combed)[:, None] * np.sin(np.pi * t)
    path = unit(path)
    level = random.random(count) ** 0.25  # 1: on the surface
    top = smooth(0.2, 0.9, path[..., 1]) * np.exp(-((path[..., 0] / 0.5) ** 2))  # (N, K)
    full = 0.0042 + 0.0065 * top * np.sin(np.pi * t) ** 0.5
    full = full + 0.004 * smooth(0.2, 0.8, t)[None]
    full = full * (1 + 0.05 * random.standard_normal(LOCKS)[lock] - 0.06 * edge)[:, None]
    rise = 1 - np.exp(-4 * t)
    above = np.linalg.norm(roots - skull.centre, axis=1) - skull.radius(start)  # (N,)
    height = above[:, None] * np.exp(-6 * t) + s * 0.0008
    height += s * rise * full * (0.15 + 0.85 * level[:, None])
    points = skull.on(path, height)
    points = clumped(points, 0.12, FINE_LOCKS, 0.42)
    points += 0.0005 * waves(count, POINTS, 0.4, random)
    disc = 0.009 * _disc(count, random)  # (N, 3)
    into = smooth(0.72, 1.0, t)[None, :, None]
    points = points * (1 - into) + into * (tie + disc)[:, None]
    hollow = np.clip(1 - level + 0.18 * edge + 0.12 * fine_edge, 0, 1)
    depth = hollow[:, None] * rise
    depth = depth + 0.45 * smooth(0.80, 1.0, t)  # strands shade one another where they meet
    taper = np.broadcast_to(0.75 + 0.25 * rise, depth.shape)
    shades = 0.13 * random.standard_normal(LOCKS)[lock]
    shades += 0.09 * random.standard_normal(FINE_LOCKS)[fine] + random.normal(0, 0.06, count)
    tone = np.exp(shades + 0.16 * (level - 0.6) + 0.10 * combed)
    return Paths(points, depth, taper, tone)


def _drift(start: np.ndarray) -> np.ndarray:
    """(N,) a smooth field over the head, about -1 to 1, in unit directions (N, 3)."""
    x, y, z = start.T
    return 0.6 * np.sin(5.1 * x + 3.3 * z + 0.4) + 0.4 * np.sin(8.3 * y - 6.1 * z + 4.0 * x)


def _disc(count: int, random: np.random.Generator) -> np.ndarray:
    """(count, 3) random points of a unit disc that faces backwards."""
    radius, turn = np.sqrt(random.random(count)), random.uniform(0, 2 * np.pi, count)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], 1)


def tail(line: np.ndarray, width: np.ndarray, count: int, random: np.random.Generator) -> Paths:
    """A bundle of strands along a line.

    Args:
        line: (L, 3) middle of the bundle from the tie to the tips, metres.
        width: (L,) its radius, metres.
        count: Number of strands.
        random: Source of all random choices.
    """
    along = np.linspace(0, 1, len(line))
    reach = 1 - 0.30 * random.random(count) ** 2.0  # (N,)
    t = np.linspace(0, 1, POINTS) * reach[:, None]  # (N, K)
    middle = np.stack([np.interp(t, along, c) for c in line.T], -1)  # (N, K, 3)
    radius = np.sqrt(random.random(count))
    turn = random.uniform(0, 2 * np.pi, count)
    side = np.array([1.0, 0.0, 0.0])
    back = unit(np.cross(np.gradient(line, axis=0), side))  # (L, 3)
    back = np.stack([np.interp(t, along, c) for c in back.T], -1)  # (N, K, 3)
    wide = np.interp(t, along, width) * radius[:, None]  # (N, K)
    points = middle + (wide * np.cos(turn)[:, None])[..., None] * side
    points += (wide * np.sin(turn)[:, None])[..., None] * back
    lock = locks(points[:, 0], TAIL_LOCKS)[0]
    points = clumped(points, 0.2, 160, 0.7)
    points += 0.004 * waves(TAIL_LOCKS, POINTS, 0.8, random)[lock]
    points += 0.0016 * waves(count, POINTS, 1.2, random)
    depth = np.broadcast_to(((1 - radius) ** 0.8)[:, None], t.shape)
    taper = np.broadcast_to(1 - 0.75 * np.linspace(0, 1, POINTS) ** 3, t.shape)
    tone = np.exp(0.14 * random.standard_normal(TAIL_LOCKS)[lock] + random.normal(0, 0.10, count))
    return Paths(points, depth, taper, tone)
