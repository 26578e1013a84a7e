"""Edges of meshes: those at which garments end, and skin that they cover."""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ico3d.studio.person.subject import Material, Subject

UNDER = 0.016
"""Metres below a collar at which skin of the neck is left out: bending cloth would let it show."""
NECK = 0.13
"""Largest distance in metres of such skin from the collar, so that hands are none."""


def sides(faces: np.ndarray) -> np.ndarray:
    """(3F, 2) sides of triangles (F, 3), the lower vertex first; what two share comes twice."""
    return np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)


def open_loops(subject: Subject, material: Material) -> list[np.ndarray]:
    """Vertices (N,) of each edge at which a garment's mesh ends."""
    faces = subject.faces[subject.materials == material]
    edges, count = np.unique(sides(faces), axis=0, return_counts=True)
    ends = edges[count == 1]
    if len(ends) == 0:
        return []
    size = len(subject.vertices)
    graph = coo_matrix((np.ones(len(ends)), tuple(ends.T)), shape=(size, size))
    label = connected_components(graph, directed=False)[1][ends[:, 0]]
    return [np.unique(ends[label == n]) for n in np.unique(label)]


def without_covered_neck(subject: Subject) -> Subject:
    """The person without the skin of the neck that lies well below the collar."""
    loops = open_loops(subject, Material.CLOTH)
    if not loops:
        return subject
    collar = max(loops, key=lambda loop: subject.vertices[loop, 1].mean())
    away, nearest = KDTree(subject.vertices[collar]).query(subject.vertices)
    below = subject.vertices[collar][nearest, 1] - subject.vertices[:, 1] > UNDER
    covered = (below & (away < NECK))[subject.faces].all(axis=1)
    kept = ~covered | (subject.materials != Material.SKIN)
    return replace(
        subject,
        faces=subject.faces[kept],
        materials=subject.materials[kept],
        corner_uv=subject.corner_uv[kept],
    )
