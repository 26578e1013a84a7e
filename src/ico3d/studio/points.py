"""Surface points of a synthetic person, from which Gaussians may start."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.person.subject import CARDS, Material, Subject

DENSITY = {
    Material.MOUTH: 3.0,
    Material.TEETH: 4.0,
    Material.TONGUE: 3.0,
    Material.EYE: 3.0,
    Material.CLOTH: 0.5,
    Material.TROUSERS: 0.5,
    Material.SKIRT: 0.5,
}
"""Points per area relative to skin and hair: small moving parts need more."""
FACE_DENSITY = 3.0


@dataclass(frozen=True)
class SurfacePoints:
    """P points that stick to a mesh.

    Attributes:
        corners: (P, 3) int vertices of the triangle that holds each point.
        parts: (P, 3) float64 barycentric weights of the vertices.
    """

    corners: np.ndarray
    parts: np.ndarray

    def on(self, vertices: np.ndarray) -> np.ndarray:
        """(P, 3) float32 positions of the points on a mesh with vertices (V, 3)."""
        return np.einsum("pk,pkc->pc", self.parts, vertices[self.corners]).astype(np.float32)


def surface_points(subject: Subject, count: int, seed: int) -> SurfacePoints:
    """Samples points on the neutral surface by area, more densely in face and mouth.

    Args:
        subject: The person.
        count: Number of points.
        seed: Seed of the random positions.
    """
    random = np.random.default_rng([seed, 2])
    solid = ~np.isin(subject.materials, CARDS)
    faces, materials = subject.faces[solid], subject.materials[solid]
    corners = subject.vertices[faces].astype(float)  # (F, 3, 3)
    sides = corners[:, 1:] - corners[:, :1]  # (F, 2, 3)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)  # (F,)
    weight = area * _density(subject, faces, materials)
    chosen = random.choice(len(faces), size=count, p=weight / weight.sum())
    u, v = random.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return SurfacePoints(faces[chosen], np.concatenate([1 - u - v, u, v], axis=1))


def _density(subject: Subject, faces: np.ndarray, materials: np.ndarray) -> np.ndarray:
    """(F,) points per area of each face."""
    density = np.ones(len(faces))
    for material, value in DENSITY.items():
        density[materials == material] = value
    moving = np.zeros(len(subject.vertices), bool)
    moving[subject.delta_vertices] = True
    density[moving[faces].all(axis=1) & (materials == Material.SKIN)] = FACE_DENSITY
    return density
