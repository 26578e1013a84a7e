"""How the studios are lit: lamps of some size, and the light that walls and floor send back."""

from dataclasses import dataclass, replace

import numpy as np

DIRECTIONS = 4096
"""Directions in which the surrounding light is sampled."""


@dataclass(frozen=True)
class Lamps:
    """The lights of a studio, in linear RGB.

    Attributes:
        directions: (3, 3) rows: directions towards key, fill and rim light, in the world.
        colors: (3, 3) rows: light of key, fill and rim light on a surface that faces them.
        sizes: (3,) tangent of half the angle under which each lamp is seen; wide lamps have soft
            shadows and broad highlights.
        sky: (3,) light of the ceiling.
        wall: (3,) light of the walls, strongest on the side of the key light.
        ground: (3,) light of the floor.
        cloth: (3,) light that the grey cloth behind the person reflects.
    """

    directions: np.ndarray
    colors: np.ndarray
    sizes: np.ndarray
    sky: np.ndarray
    wall: np.ndarray
    ground: np.ndarray
    cloth: np.ndarray

    @property
    def towards(self) -> np.ndarray:
        """(3, 3) rows: unit vectors towards the lamps, in the world."""
        return self.directions / np.linalg.norm(self.directions, axis=1, keepdims=True)

    def surroundings(self, directions: np.ndarray) -> np.ndarray:
        """(N, 3) light that walls, ceiling and floor send from unit directions (N, 3)."""
        up = directions[:, 1:2]  # (N, 1)
        key = self.towards[0] * (1, 0, 1)
        aside = 0.5 + 0.5 * (directions @ (key / np.linalg.norm(key)))[:, None]  # (N, 1)
        high, low = np.clip(up, 0, 1) ** 0.7, np.clip(-up, 0, 1) ** 0.5
        level = self.wall * (0.35 + 1.0 * aside**2)
        return level * (1 - high) * (1 - low) + self.sky * high + self.ground * low

    def harmonics(self) -> np.ndarray:
        """(9, 3) the surroundings' irradiance over π as spherical harmonics of degree 2.

        Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps":
        a diffuse surface with normal n reflects its albedo times `harmonic_basis(n)` times this.
        """
        index = np.arange(DIRECTIONS) + 0.5
        height, turn = 1 - 2 * index / DIRECTIONS, np.pi * (1 + 5**0.5) * index
        ring = np.sqrt(1 - height**2)
        towards = np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], 1)  # (N, 3)
        basis = harmonic_basis(towards)  # (N, 9)
        light = 4 * np.pi / DIRECTIONS * basis.T @ self.surroundings(towards)  # (9, 3)
        return light * np.repeat([1.0, 2 / 3, 1 / 4], [1, 3, 5])[:, None]


def harmonic_basis(directions: np.ndarray) -> np.ndarray:
    """(N, 9) real spherical harmonics up to degree 2 in unit directions (N, 3)."""
    x, y, z = directions.T
    return np.stack(
        [
            np.full_like(x, 0.282095),
            0.488603 * y,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * y,
            1.092548 * y * z,
            0.315392 * (3 * z * z - 1),
            1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ],
        axis=1,
    )


_STUDIO = Lamps(
    np.array([[-0.74, 0.62, 0.74], [0.85, 0.12, 0.60], [0.66, 0.58, -0.98]]),
    np.array([[1.64, 1.55, 1.43], [0.33, 0.34, 0.36], [1.40, 1.42, 1.46]]),
    np.array([0.30, 0.45, 0.20]),
    np.array([0.27, 0.285, 0.305]),
    np.array([0.21, 0.22, 0.235]),
    np.array([0.145, 0.13, 0.12]),
    np.array([0.92, 0.97, 1.06]),
)
STUDIOS = {
    "studio": _STUDIO,
    "soft": replace(
        _STUDIO,
        colors=np.array([[1.25, 1.19, 1.11], [0.50, 0.51, 0.53], [1.10, 1.12, 1.15]]),
        sizes=np.array([0.75, 0.80, 0.50]),
        sky=np.array([0.34, 0.355, 0.38]),
        wall=np.array([0.285, 0.295, 0.315]),
        ground=np.array([0.27, 0.24, 0.225]),
    ),
    "warm": Lamps(
        np.array([[0.82, 0.58, 0.60], [-0.80, 0.20, 0.55], [-0.60, 0.62, -0.80]]),
        np.array([[1.95, 1.44, 0.92], [0.18, 0.18, 0.19], [1.05, 0.86, 0.68]]),
        np.array([0.16, 0.45, 0.16]),
        np.array([0.28, 0.25, 0.21]),
        np.array([0.23, 0.195, 0.16]),
        np.array([0.18, 0.125, 0.08]),
        np.array([1.02, 0.90, 0.76]),
    ),
}
"""`studio`: neutral, key light from the person's right; `soft`: the same through wide cloths, which
leaves little shade of an arm on a body; `warm`: like bulbs, from the left."""
