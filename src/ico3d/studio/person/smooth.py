"""Smooths the visible parts of a coarse mesh: splits triangles in four, following the normals."""

from dataclasses import replace

import numpy as np

from ico3d.studio.person.edges import sides
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import Subject
from ico3d.studio.raster import vertex_normals

BULGE = 0.75
"""How far new vertices move from the flat triangle (0) to the curved surface (1)."""


def smoothed(subject: Subject, chosen: np.ndarray, bulge: float = BULGE) -> Subject:
    """Splits triangles into four that bulge as their normals imply (Phong tessellation).

    Args:
        subject: The person; landmarks and eyes are not changed.
        chosen: (F,) bool, the faces to split; they must not share edges with unsplit faces.
        bulge: How far new vertices move from the flat triangle (0) to the curved surface (1).
    """
    coarse = subject.faces[chosen]
    if len(coarse) == 0:
        return subject
    edges, edge_of = np.unique(sides(coarse), axis=0, return_inverse=True)
    a, b, c = coarse.T
    ab, bc, ca = (len(subject.vertices) + edge_of).reshape(-1, 3).T
    split = np.stack([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)])  # (4, 3, F)
    faces = split.transpose(2, 0, 1).reshape(-1, 3)
    vertices = np.concatenate([subject.vertices, _edge_middles(subject, edges, bulge)])
    delta_vertices, deltas = _split_deltas(subject, edges)
    return replace(
        subject,
        vertices=vertices.astype(np.float32),
        faces=np.concatenate([subject.faces[~chosen], faces]).astype(np.int32),
        materials=np.concatenate(
            [subject.materials[~chosen], np.repeat(subject.materials[chosen], 4)]
        ),
        corner_uv=np.concatenate([subject.corner_uv[~chosen], _split_uv(subject, chosen)]),
        lip_mask=np.concatenate([subject.lip_mask, subject.lip_mask[edges].mean(axis=1)]),
        delta_vertices=delta_vertices,
        deltas=deltas,
        skeleton=_split_skeleton(subject, edges),
    )


def _split_uv(subject: Subject, chosen: np.ndarray) -> np.ndarray:
    """(4F, 3, 2) float32 texture coordinates of the split faces."""
    uv = subject.corner_uv[chosen]  # (F, 3, 2)
    half = 0.5 * (uv + np.roll(uv, -1, axis=1))  # of edges 01, 12, 20
    parts = [
        np.stack([uv[:, 0], half[:, 0], half[:, 2]], 1),
        np.stack([half[:, 0], uv[:, 1], half[:, 1]], 1),
        np.stack([half[:, 2], half[:, 1], uv[:, 2]], 1),
        half,
    ]
    return np.stack(parts, axis=1).reshape(-1, 3, 2).astype(np.float32)


def _split_deltas(subject: Subject, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moved vertices (M + N,) and deltas (K, M + N, 3): a middle moves as its ends do."""
    row = np.full(len(subject.vertices), -1)
    row[subject.delta_vertices] = np.arange(len(subject.delta_vertices))
    ends = row[edges]  # (E, 2)
    moved = (ends >= 0).any(axis=1)
    index = len(subject.vertices) + np.flatnonzero(moved)
    shape_count = len(subject.deltas)
    padded = np.concatenate([subject.deltas, np.zeros((shape_count, 1, 3), np.float32)], axis=1)
    first, second = ends[moved].T  # (N,) each; row -1 is the zero at the end
    middles = np.stack([0.5 * (shape[first] + shape[second]) for shape in padded])  # (K, N, 3)
    return (
        np.concatenate([subject.delta_vertices, index]).astype(np.int32),
        np.concatenate([subject.deltas, middles], axis=1).astype(np.float32),
    )


def _split_skeleton(subject: Subject, edges: np.ndarray) -> Skeleton | None:
    """The skeleton on which middles hang as their ends do."""
    if subject.skeleton is None:
        return None
    weights = subject.skeleton.weights
    middles = weights[edges].mean(axis=1)  # (E, J)
    return replace(subject.skeleton, weights=np.concatenate([weights, middles]))


def _edge_middles(subject: Subject, edges: np.ndarray, bulge: float) -> np.ndarray:
    """(E, 3) points in the middle of edges, moved onto the curved surface."""
    normals = vertex_normals(subject.vertices, subject.faces)
    ends, across = subject.vertices[edges], normals[edges]  # (E, 2, 3) each
    middle = ends.mean(axis=1)
    above = ((ends - middle[:, None]) * across).sum(axis=2, keepdims=True)  # (E, 2, 1)
    return middle + bulge * (above * across).mean(axis=1)
