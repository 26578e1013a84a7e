"""Strands that escape from tied hair: at the hairline and over the crown."""

import numpy as np

from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import Paths, smooth, unit, waves

BABY_POINTS, FLYAWAY_POINTS = 6, 10
BABY = (0.007, 0.022)
"""Shortest and longest hair at the hairline, metres."""
BABY_TAPER, FLYAWAY_TAPER = 0.42, 0.45
"""Thickness relative to other hair."""
LIGHT = 1.25
"""Tone of strands that stand alone: light goes through them from all sides."""


def baby(skull: Skull, roots: np.ndarray, combed: np.ndarray, random: np.random.Generator) -> Paths:
    """Short fine hairs at the hairline, which follow the comb only roughly.

    Args:
        skull: The head.
        roots: (N, 3) places of the roots, metres.
        combed: (N, 3) unit directions of the hair behind them.
        random: Source of all random choices.
    """
    count = len(roots)
    start = unit(roots - skull.centre)
    flat = unit(combed - start * (combed * start).sum(1, keepdims=True))
    across = np.cross(start, flat)
    turn = random.normal(0, 0.45, count)[:, None]
    way = np.cos(turn) * flat + np.sin(turn) * across
    curl = random.normal(0, 0.5, count)[:, None, None]
    length = skull.scale * random.uniform(*BABY, count)[:, None, None]
    t = np.linspace(0, 1, BABY_POINTS)[None, :, None]
    points = roots[:, None] + length * (t * way[:, None] + 0.5 * curl * t**2 * across[:, None])
    foot = unit(points - skull.centre)  # (N, K, 3)
    above = np.linalg.norm(roots - skull.centre, axis=1) - skull.radius(start)
    lift = random.uniform(0.0006, 0.0030, count)[:, None] * t[..., 0] ** 1.5
    points = skull.on(foot, above[:, None] + 0.0002 + lift)
    taper = np.broadcast_to(BABY_TAPER * (1 - 0.8 * t[..., 0] ** 1.3), points.shape[:2])
    return Paths(points, np.zeros(points.shape[:2]), taper, _light(count, random))


def flyaways(skull: Skull, combed: np.ndarray, random: np.random.Generator) -> Paths:
    """Strands that leave the surface of combed ones (N, K, 3) in wide arcs and end in the air."""
    count, length = combed.shape[:2]
    begin = random.uniform(0.10, 0.35, count)[:, None]
    t = np.linspace(0, 1, FLYAWAY_POINTS)
    place = (begin + random.uniform(0.18, 0.45, count)[:, None] * t) * (length - 1)
    low = np.minimum(place.astype(int), length - 2)
    part = (place - low)[..., None]
    row = np.arange(count)[:, None]
    points = (1 - part) * combed[row, low] + part * combed[row, low + 1]
    lift = random.gamma(2.2, 0.0022, count)[:, None] * t**1.3
    points += (skull.scale * lift)[..., None] * unit(points - skull.centre)
    points += 0.003 * waves(count, FLYAWAY_POINTS, 0.35, random)
    taper = np.broadcast_to(FLYAWAY_TAPER * (1 - 0.7 * t**2), points.shape[:2])
    return Paths(points, np.zeros(points.shape[:2]), taper, _light(count, random))


def _light(count: int, random: np.random.Generator) -> np.ndarray:
    """(count,) tones of strands that stand alone."""
    return LIGHT * np.exp(random.normal(0, 0.12, count))


def near_edge(inside: np.ndarray) -> np.ndarray:
    """(N,) how many baby hairs grow `inside` (N,) metres from the hairline, 0 to 1."""
    return smooth(-0.009, 0.001, inside) * (1 - smooth(0.006, 0.014, inside))
