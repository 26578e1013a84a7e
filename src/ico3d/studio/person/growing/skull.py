"""The head without ears, as a radius in each direction, and where hair grows on it."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import KDTree

from ico3d.studio.person.subject import Material, Subject

HAIRLINE_ANGLE = np.radians([0.0, 15.0, 30.0, 45.0, 58.0, 70.0, 84.0, 100.0, 130.0, 180.0])
HAIRLINE_HEIGHT = np.array(
    [0.0515, 0.0525, 0.0500, 0.0425, 0.0285, 0.0050, -0.0200, 0.010, -0.050, -0.072]
)
"""Height of the hairline above the eyes in metres, for each of `HAIRLINE_ANGLE` from the front."""
HALF_WIDTH = 0.0677
"""Half of the head's width above the ears for which the lengths here hold, metres."""
EAR, EAR_RADIUS = np.array([0.075, -0.016, -0.012]), 0.020
GRID = (90, 180)
"""Polar and azimuthal steps of the map of radii."""
NECK = -0.10


@dataclass(frozen=True)
class Skull:
    """A head as a radius in each direction from a centre.

    Attributes:
        centre: (3,) canonical head space, metres.
        radii: `GRID` metres, by angle from +Y and by angle from +Z towards +X.
        scale: Size of the head relative to the one for which this module's lengths hold.
    """

    centre: np.ndarray
    radii: np.ndarray
    scale: float

    def radius(self, directions: np.ndarray) -> np.ndarray:
        """(...,) metres from the centre to the skin in unit directions (..., 3)."""
        rows, columns = GRID
        polar = np.arccos(np.clip(directions[..., 1], -1, 1)) / np.pi * (rows - 1)
        turn = np.arctan2(directions[..., 0], directions[..., 2]) / (2 * np.pi) * columns
        return map_coordinates(self.radii, [polar, turn], order=1, mode="grid-wrap")

    def on(self, directions: np.ndarray, height: np.ndarray) -> np.ndarray:
        """(..., 3) points at a height (...,) above the skin in unit directions (..., 3)."""
        return self.centre + directions * (self.radius(directions) + height)[..., None]

    def inside_hairline(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres from the hairline; negative on face, ears and neck."""
        x, y, z = (points / self.scale).T
        angle = np.arctan2(np.abs(x), z + 0.005)
        step = np.radians(3)
        above, below = (
            np.interp(angle + d, HAIRLINE_ANGLE, HAIRLINE_HEIGHT) for d in (step, -step)
        )
        steepness = (above - below) / (2 * step * HALF_WIDTH)
        depth = (y - 0.5 * (above + below)) / np.hypot(1, steepness)
        from_ear = np.linalg.norm(np.stack([np.abs(x), y, z], 1) - EAR, axis=1) - EAR_RADIUS
        ear = (np.abs(x) > HALF_WIDTH + 0.005) & (y < 0.004)
        return self.scale * np.where(ear, -1.0, np.minimum(depth, from_ear))


def skull_of(subject: Subject) -> Skull | None:
    """Measures a head; None for a mesh that is none."""
    skin = subject.vertices[np.unique(subject.faces[subject.materials == Material.SKIN])]
    skin = skin[skin[:, 1] > NECK].astype(float)
    above = skin[(skin[:, 1] > 0.035) & (skin[:, 1] < 0.07)]  # the ears
    if len(above) < 100 or skin[:, 2].min() > -0.05:
        return None
    half = float(np.abs(above[:, 0]).max())
    scale = half / HALF_WIDTH
    middle = 0.5 * (above[:, 2].min() + above[:, 2].max())
    centre = np.array([0.0, 0.020 * scale, middle])
    ear = (np.abs(skin[:, 0]) > half + 0.001) & (skin[:, 1] < 0.04)
    return Skull(centre, _radii(skin[~ear] - centre), scale)


def _radii(local: np.ndarray) -> np.ndarray:
    """`GRID` radii of a head with skin at (N, 3) from its centre."""
    radius = np.linalg.norm(local, axis=1)
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, GRID[0]), np.arange(GRID[1]) * 2 * np.pi / GRID[1], indexing="ij"
    )
    ring = np.sin(polar)
    wanted = np.stack([ring * np.sin(turn), np.cos(polar), ring * np.cos(turn)], -1)
    away, near = KDTree(local / radius[:, None]).query(wanted, k=6)
    weights = 1 / (away + 1e-3)
    radii = (weights * radius[near]).sum(-1) / weights.sum(-1)
    return gaussian_filter(radii, 1.0, mode=("nearest", "wrap"))
