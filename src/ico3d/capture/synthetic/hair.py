"""Makes the coarse hair of a mesh smooth, and finds where it ends."""

from dataclasses import replace

import numpy as np

from ico3d.capture.synthetic.raster import vertex_normals
from ico3d.capture.synthetic.subject import Material, Subject

BULGE = 0.75
"""How far split edges move from the flat triangle to the surface the normals tell of."""


def with_smooth_hair(subject: Subject) -> Subject:
    """Splits each hair triangle into four that follow the normals (Phong tessellation)."""
    is_hair = subject.materials == Material.HAIR
    hair = subject.faces[is_hair]
    if len(hair) == 0:
        return subject
    corners = hair[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)  # (3F, 2)
    edges, edge_of = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
    middle = (len(subject.vertices) + edge_of).reshape(-1, 3)  # (F, 3): of edges 01, 12, 20
    a, b, c = hair.T
    ab, bc, ca = middle.T
    split = np.stack([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)])  # (4, 3, F)
    faces = split.transpose(2, 0, 1).reshape(-1, 3)
    uv = subject.corner_uv[is_hair]  # (F, 3, 2)
    half = 0.5 * (uv + np.roll(uv, -1, axis=1))  # of edges 01, 12, 20
    parts = [
        np.stack([uv[:, 0], half[:, 0], half[:, 2]], 1),
        np.stack([half[:, 0], uv[:, 1], half[:, 1]], 1),
        np.stack([half[:, 2], half[:, 1], uv[:, 2]], 1),
        half,
    ]
    split_uv = np.stack(parts, axis=1).reshape(-1, 3, 2)
    new = _edge_middles(subject, edges)
    return replace(
        subject,
        vertices=np.concatenate([subject.vertices, new]).astype(np.float32),
        faces=np.concatenate([subject.faces[~is_hair], faces]).astype(np.int32),
        materials=np.concatenate(
            [subject.materials[~is_hair], np.full(len(faces), Material.HAIR, np.uint8)]
        ),
        corner_uv=np.concatenate([subject.corner_uv[~is_hair], split_uv]).astype(np.float32),
        lip_mask=np.concatenate([subject.lip_mask, np.zeros(len(new), np.float32)]),
    )


def _edge_middles(subject: Subject, edges: np.ndarray) -> np.ndarray:
    """(E, 3) points in the middle of edges, moved onto the curved surface."""
    normals = vertex_normals(subject.vertices, subject.faces)
    ends, across = subject.vertices[edges], normals[edges]  # (E, 2, 3) each
    middle = ends.mean(axis=1)
    above = ((ends - middle[:, None]) * across).sum(axis=2, keepdims=True)  # (E, 2, 1)
    return middle + BULGE * (above * across).mean(axis=1)


def hair_edge(subject: Subject) -> np.ndarray:
    """Vertices (N,) on open edges of the hair: where sheets of hair end."""
    hair = subject.faces[subject.materials == Material.HAIR]
    corners = np.sort(hair[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(corners, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def strand_frames(subject: Subject) -> np.ndarray:
    """Where strands run at each vertex, from texture coordinates.

    Returns:
        (V, 4) float32: unit vector along v, and units of u per metre across it.
    """
    corners, uv = subject.vertices[subject.faces], subject.corner_uv
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]  # (F, 3)
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]  # (F, 2)
    determinant = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]  # (F,)
    fine = np.abs(determinant) > 1e-14
    safe = np.where(fine, determinant, 1.0)[:, None]
    along = (e2 * d1[:, :1] - e1 * d2[:, :1]) / safe
    across = np.linalg.norm((e1 * d2[:, 1:] - e2 * d1[:, 1:]) / safe, axis=1)  # metres per u
    rows = np.zeros((len(corners), 5))
    rows[:, :3] = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    rows[:, 3] = 1 / np.maximum(across, 1e-3)
    rows[:, 4] = 1
    rows[~fine] = 0
    frames = np.zeros((len(subject.vertices), 5))
    for corner in range(3):
        np.add.at(frames, subject.faces[:, corner], rows)
    frames[:, 3] /= np.maximum(frames[:, 4], 1)
    length = np.linalg.norm(frames[:, :3], axis=1, keepdims=True)
    frames[:, :3] /= np.maximum(length, 1e-9)
    return frames[:, :4].astype(np.float32)
