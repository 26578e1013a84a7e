"""Directions of strands on sheets of hair."""

import numpy as np

from ico3d.studio.person.subject import Subject


def strand_frames(subject: Subject) -> np.ndarray:
    """Direction and density of hair strands at each vertex, from texture coordinates.

    Returns:
        (V, 4) float32: the unit vector along which v grows, and u per metre across the strands.
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
