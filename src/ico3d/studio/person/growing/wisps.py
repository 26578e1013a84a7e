"""Strands that escape from tied hair: at the hairline, before the ears and over the crown."""

import numpy as np

from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.growing.styles import Paths, smooth, unit, waves

BABY_POINTS, FRAMING_POINTS, FLYAWAY_POINTS = 6, 14, 10
BABY = (0.007, 0.022)
"""Shortest and longest hair at the hairline, metres."""
BABY_TAPER, FRAMING_TAPER, FLYAWAY_TAPER = 0.42, 0.55, 0.45
"""Thickness relative to other hair."""
LIGHT = 1.25
"""Tone of strands that stand alone: light goes through them from all sides."""
FRAMING = (
    (1.0, 1.12, 0.004, 0.062),
    (1.0, 1.26, 0.006, 0.044),
    (-1.0, 1.10, 0.004, 0.052),
    (-1.0, 1.22, 0.006, 0.066),
)
"""Wisps before the ears: side, azimuth of the root in radians, metres inside the hairline, and
length in metres."""
OFF = 0.0025
"""Least distance of a wisp from the skin, metres."""


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


def framing(
    skull: Skull, roots: np.ndarray, wisp: np.ndarray, random: np.random.Generator
) -> Paths:
    """Loose strands from roots (N, 3) that fall before the ears; wisp (N,) is which each is of."""
    count = len(roots)
    side, _, _, long = np.array(FRAMING)[wisp].T
    t = np.linspace(0, 1, FRAMING_POINTS)
    length = skull.scale * (long * random.uniform(0.7, 1.05, count))[:, None]
    swing = random.normal(0, 0.0018, (count, 2, 1))
    points = np.repeat(roots[:, None], FRAMING_POINTS, 1)  # (N, K, 3)
    points[..., 1] -= length * (t**1.15)
    bend = np.sin(np.pi * np.minimum(1, 1.25 * t)) - 0.5 * t**2
    points[..., 0] += side[:, None] * (0.007 * bend + 0.003 * t + swing[:, 0] * t)
    points[..., 2] += 0.006 * np.sin(1.9 * np.pi * t + 0.5 * wisp[:, None]) * t + swing[:, 1] * t
    points += 0.0005 * waves(count, FRAMING_POINTS, 0.7, random)
    away = points - skull.centre
    far = np.linalg.norm(away, axis=-1)
    least = skull.radius(away / far[..., None]) + OFF
    points = skull.centre + away * (np.maximum(far, least) / far)[..., None]
    points[:, 0] = roots
    taper = np.broadcast_to(FRAMING_TAPER * (1 - 0.7 * t**2), points.shape[:2])
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
