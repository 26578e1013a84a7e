"""A fringe that is parted above the forehead and combed back, with some locks before the ears."""

import numpy as np

from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import Paths, clumped, smooth, unit, waves
from ico3d.studio.person.growing.tied import locks

POINTS = 20
LOCKS = 58
"""Locks of a fringe: strands of one hang together, and differ in tone and length from others."""
PARTING = np.radians(7.0)
"""Where it is parted, from the middle of the face to the left."""
WIDEST = np.radians(74.0)
"""How far from the middle it begins."""
THIN = 0.25
"""Logarithm of how much brighter a fringe is than other hair: light goes through it."""
HANGING = -0.7
"""Locks darker than others by this, in deviations, hang before the ear, few as they are; all others
are combed back over it."""
DEEPEST = 0.026
"""Metres behind the hairline from which it comes."""


def belongs(skull: Skull, places: np.ndarray) -> np.ndarray:
    """(N,) whether hair at places (N, 3) on the scalp, metres, is part of a fringe."""
    start = unit(places - skull.centre)
    angle = np.abs(np.arctan2(start[:, 0], start[:, 2]))
    inside = skull.inside_hairline(places)
    deep = skull.scale * DEEPEST * (1 - 0.6 * (angle / WIDEST) ** 2)
    return (angle < WIDEST) & (inside > -0.002) & (inside < deep)


def curtain(skull: Skull, roots: np.ndarray, random: np.random.Generator) -> Paths:
    """Hair that rises from its roots and ends behind the temples, in part beside the cheeks.

    Args:
        skull: The head.
        roots: (N, 3) places of the roots, metres.
        random: Source of all random choices.
    """
    count = len(roots)
    start = unit(roots - skull.centre)
    turn = np.arctan2(start[:, 0], start[:, 2])
    lock, edge = locks(roots, LOCKS)
    of_lock = random.standard_normal((LOCKS, 4))[lock]
    parted = turn - PARTING + 0.03 * random.standard_normal(count)
    level = random.random(count) ** 0.6  # 1: on the surface
    ways = _falling(start, parted, of_lock, lock, random)
    t = np.linspace(0, 1, POINTS)
    swept = _swept(of_lock)
    full = 0.004 + 0.0075 * np.sin(np.pi * np.minimum(1, 1.15 * t) ** 0.8) ** 1.2
    full = np.where(swept[:, None], 0.85 - 0.2 * t, 1.0) * full
    flick = np.where(swept, 0.0, 0.007 + 0.005 * of_lock[:, 2])[:, None] * t**4
    lift = skull.scale * (full * (0.35 + 0.65 * level[:, None]) * (1 - np.exp(-9 * t)) + flick)
    above = np.linalg.norm(roots - skull.centre, axis=1) - skull.radius(start)  # (N,)
    points = skull.on(ways, above[:, None] * np.exp(-6 * t) + 0.0008 + lift)
    for one in (parted >= 0, parted < 0):
        for way in (swept, ~swept):
            points[one & way] = clumped(points[one & way], 0.15, 70, 0.8)
    points += 0.0030 * waves(LOCKS, POINTS, 0.75, random)[lock]
    points += 0.0012 * waves(count, POINTS, 0.7, random)
    depth = np.clip(1 - level + 0.2 * edge, 0, 1)[:, None] * np.minimum(1, 4 * t)
    taper = np.broadcast_to(0.9 - 0.7 * t**2, depth.shape)
    shades = 0.13 * of_lock[:, 3] + random.normal(0, 0.08, count) + 0.12 * (level - 0.5)
    return Paths(points, depth, taper, np.exp(shades + THIN))


def _falling(
    start: np.ndarray,
    parted: np.ndarray,
    of_lock: np.ndarray,
    lock: np.ndarray,
    random: np.random.Generator,
) -> np.ndarray:
    """(N, K, 3) unit directions from the skull's centre, along strands that begin at (N, 3).

    Args:
        start: (N, 3) unit directions of the roots.
        parted: (N,) angle from the parting to the left, radians.
        of_lock: (N, 4) what strands of a lock have in common, of unit deviation.
        lock: (N,) the lock of each strand.
        random: Source of all random choices.
    """
    count = len(start)
    turn, rise = np.arctan2(start[:, 0], start[:, 2]), np.arcsin(start[:, 1])
    out = np.clip(np.abs(parted) / WIDEST, 0, 1)  # 0 at the parting
    aim = 61 + 13 * out + 6.0 * of_lock[:, 0] + 3.0 * random.standard_normal(count)
    swept = _swept(of_lock)
    behind = 112 + 6 * of_lock[:, 0] + 3.0 * random.standard_normal(count)
    aim = np.where(parted < 0, -1.0, 1.0) * np.radians(np.where(swept, behind, aim))
    low = 24 + 22 * out + 16.0 * of_lock[:, 1] + 5.0 * random.standard_normal(count)
    above = -4 + 9 * out + 5.0 * of_lock[:, 1] + 2.0 * random.standard_normal(count)
    low = -np.radians(np.where(swept, above, np.clip(low, -5, 62)))
    t = np.linspace(0, 1, POINTS)
    down = t ** (1.25 + 0.2 * random.standard_normal(LOCKS)[lock])[:, None]
    angle = turn[:, None] + (aim - turn)[:, None] * smooth(0.0, 0.82, t) ** 0.85
    height = rise[:, None] + (low - rise)[:, None] * down
    ring = np.cos(height)
    return np.stack([ring * np.sin(angle), np.sin(height), ring * np.cos(angle)], -1)


def _swept(of_lock: np.ndarray) -> np.ndarray:
    """(N,) whether strands of locks (N, 4) are combed back over the ear."""
    return of_lock[:, 3] > HANGING
