"""Surface points of a synthetic person, from which Gaussians may start."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.person.scatter import areas, scattered
from ico3d.studio.person.strands import Strands
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
HAIRS = 0.25
"""Share of the points that lie on strands of hair."""


@dataclass(frozen=True)
class SurfacePoints:
    """P points that stick to a mesh and its hair.

    Attributes:
        corners: (Q, 3) int vertices of the triangle that holds each of the first Q points.
        parts: (Q, 3) float64 barycentric weights of the vertices.
        strands: Hair that holds the other points, or None.
        chosen: (P - Q,) int points of the strands.
    """

    corners: np.ndarray
    parts: np.ndarray
    strands: Strands | None
    chosen: np.ndarray

    def on(self, vertices: np.ndarray) -> np.ndarray:
        """(P, 3) float32 positions of the points on a mesh with vertices (V, 3)."""
        places = np.einsum("pk,pkc->pc", self.parts, vertices[self.corners]).astype(np.float32)
        if self.strands is None:
            return places
        return np.concatenate([places, self.strands.on(vertices)[self.chosen]])  # (P, 3)


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
    weight = areas(corners) * _density(subject, faces, materials)
    hairs = 0 if subject.strands is None else round(HAIRS * count)
    chosen, parts = scattered(weight, count - hairs, random)
    held = 1 if subject.strands is None else len(subject.strands.offsets)
    return SurfacePoints(
        faces[chosen], parts, subject.strands, random.choice(held, size=hairs, replace=hairs > held)
    )


def _density(subject: Subject, faces: np.ndarray, materials: np.ndarray) -> np.ndarray:
    """(F,) points per area of each face."""
    density = np.ones(len(faces))
    for material, value in DENSITY.items():
        density[materials == material] = value
    moving = np.zeros(len(subject.vertices), bool)
    moving[subject.delta_vertices] = True
    density[moving[faces].all(axis=1) & (materials == Material.SKIN)] = FACE_DENSITY
    return density
