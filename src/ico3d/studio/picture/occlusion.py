"""What vertices see of the sky and of wide lamps, from depth maps in many directions."""

import numpy as np

from ico3d.splat.cpu.compile import kernel
from ico3d.studio.person.subject import CARDS, Subject
from ico3d.studio.picture.shadows import vogel_disc
from ico3d.studio.raster import depth_map, light_basis, vertex_normals

BIAS = 1.4
"""Depth in texels behind a depth map at which a surface still counts as lit."""
WIDE = 0.05
"""Share of light that reaches the deepest fold."""
ON_LAMP = 24
"""Directions in which a lamp is looked for."""


class Sky:
    """Finds occlusion of one person's meshes."""

    def __init__(self, subject: Subject, size: int, reach: float, directions: int):
        """Prepares for meshes of a person.

        Args:
            subject: The person.
            size: Texels along the side of a depth map.
            reach: Half its side in metres.
            directions: Number of directions, spread evenly.
        """
        self._faces = subject.faces
        self._solid = np.flatnonzero(~np.isin(subject.materials, CARDS)).astype(np.int32)
        self._size, self._reach = size, reach
        self._directions = _sphere(directions)

    def visible(self, vertices: np.ndarray) -> np.ndarray:
        """(V,) float32 cosine-weighted part of the sky that each vertex sees.

        Args:
            vertices: (V, 3) float32 metres from the middle of the depth maps; what lies outside of
                them counts as lit.
        """
        return WIDE + np.float32(1 - WIDE) * self._share(vertices, self._directions)

    def lamp(self, vertices: np.ndarray, towards: np.ndarray, size: float) -> np.ndarray:
        """(V,) float32 cosine-weighted part of a distant round lamp that each vertex sees.

        Args:
            vertices: (V, 3) float32 metres from the middle of the depth maps.
            towards: (3,) unit vector towards the lamp.
            size: Tangent of half the angle under which the lamp is seen.
        """
        right, down, middle = light_basis(towards)
        across = size * vogel_disc(ON_LAMP) @ np.stack([right, down])  # (N, 3)
        directions = middle + across
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self._share(vertices, directions.astype(np.float32))

    def _share(self, vertices: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(V,) float32 cosine-weighted part of directions (N, 3) in which nothing is met.

        It is 1 for a vertex that faces none of them.
        """
        normals = vertex_normals(vertices, self._faces)
        seen, total = np.full((2, len(vertices)), 1e-6, np.float32)
        bias = BIAS * 2 * self._reach / self._size
        for direction in directions:
            nearest, screen = depth_map(
                vertices, self._faces, self._solid, direction, self._size, self._reach
            )
            _add_lit(screen, nearest, bias, normals, direction, seen, total)
        return seen / total


def _sphere(count: int) -> np.ndarray:
    """(count, 3) float32 directions spread evenly (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = 1 - 2 * index / count
    angle = np.pi * (1 + 5**0.5) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), height, ring * np.sin(angle)], 1).astype(np.float32)


@kernel(fast=False)
def _add_lit(screen, nearest, bias, normals, direction, seen, total):
    """Adds cosines to `total`, and to `seen` (V,) where nothing hides the vertex."""
    size = nearest.shape[0]
    for i in range(screen.shape[0]):
        cosine = (
            normals[i, 0] * direction[0]
            + normals[i, 1] * direction[1]
            + normals[i, 2] * direction[2]
        )
        if cosine <= 0.0:
            continue
        total[i] += cosine
        x, y = int(screen[i, 0]), int(screen[i, 1])
        outside = x < 0 or y < 0 or x >= size or y >= size
        if outside or nearest[y, x] <= screen[i, 2] + bias:
            seen[i] += cosine
