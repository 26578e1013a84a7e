"""What is painted on a person once: flush, freckles, beard, and ambient occlusion."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from ico3d.studio.person.hair import hair_edge, strand_frames
from ico3d.studio.person.subject import CARDS, Subject
from ico3d.studio.raster import empty_buffers, rasterise, vertex_normals

OPENINGS = (0.0, 0.12, 0.25, 0.45)
"""Weights of `jawOpen` for which occlusion is computed; frames interpolate between them."""
DIRECTIONS = 64
HEAD_MAP = (448, 0.24)
"""Depth map of head and neck: texels along the side, and half of the side in metres.

Everything outside of the map counts as lit.
"""
BODY_MAP = (640, 1.1)
"""Depth map of a whole person: texels along the side, and half of the side in metres."""
NECK = -0.2
"""Height in metres below which a whole person's occlusion comes from the map of the body."""
BIAS = 1.4
"""Depth in texels behind a depth map at which a surface still counts as lit."""
SCALP_REACH = 0.006
"""Distance in metres over which roots of hair darken the skin."""
WIDE = 0.06
"""Share of light that reaches the deepest fold after reflection from other skin."""


@dataclass(frozen=True)
class Paint:
    """Values per vertex that textures and shading need.

    Attributes:
        channels: (V, 6) float32: lip, redness, freckles, beard, scalp, each 0 to 1, and the depth
            behind the lips in metres.
        strands: (V, 4) float32, as `strand_frames` returns them.
        openings: (O,) float32 gap of the inner lips in metres for each of `OPENINGS`, ascending.
        occlusion: (O, V) float32 visible share of the sky for each of `OPENINGS`.
    """

    channels: np.ndarray
    strands: np.ndarray
    openings: np.ndarray
    occlusion: np.ndarray

    def occlusion_at(self, gap: float) -> np.ndarray:
        """(V,) float32 visible share of the sky for a gap of the inner lips in metres."""
        at = float(np.interp(gap, self.openings, np.arange(len(self.openings))))
        low = min(int(at), len(self.openings) - 2)
        part = np.float32(at - low)
        return self.occlusion[low] * (1 - part) + self.occlusion[low + 1] * part


def paint(subject: Subject) -> Paint:
    """Computes the painted values of a person; takes about a second."""
    gaps, occlusion = [], []
    for opening in OPENINGS:
        shape = {"jawOpen": opening}
        for side in ("Left", "Right"):
            shape[f"mouthLowerDown{side}"] = 0.6 * opening
            shape[f"mouthUpperUp{side}"] = 0.3 * opening
        vertices = subject.posed(subject.weights(shape))
        gaps.append(lip_gap(subject.landmarks(vertices)))
        occlusion.append(_sky_visibility(subject, vertices, *HEAD_MAP))
    if subject.skeleton is not None:
        below = subject.vertices[:, 1] < NECK
        middle = 0.5 * (subject.vertices.max(axis=0) + subject.vertices.min(axis=0))
        seen = _sky_visibility(subject, subject.vertices - middle, *BODY_MAP)
        occlusion = [np.where(below, seen, old) for old in occlusion]
    return Paint(
        _channels(subject), strand_frames(subject), np.array(gaps, np.float32), np.stack(occlusion)
    )


def lip_gap(landmarks: np.ndarray) -> float:
    """Distance in metres between the middles of the inner lips in landmarks (68, 3)."""
    return float(np.linalg.norm(landmarks[62] - landmarks[66]))


def _bump(vertices: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """(V,) a smooth hill of height 1 about a point."""
    distance = ((vertices - centre) ** 2).sum(axis=1)
    return np.exp(-distance / (2 * radius**2))


def _channels(subject: Subject) -> np.ndarray:
    vertices, marks = subject.vertices, subject.landmarks(subject.vertices)
    width = float(np.linalg.norm(marks[16] - marks[0]))  # of the face, about 0.13 m
    eyes = [eye.centre for eye in subject.eyes]
    cheeks = [
        np.array([eye[0] * 1.35, 0.5 * marks[30, 1] + 0.1 * eye[1], marks[30, 2] - 0.25 * width])
        for eye in eyes
    ]
    ears = [np.array([s * 0.57 * width, marks[30, 1] / 2, -0.02]) for s in (1, -1)]
    beside = np.maximum(*(_bump(vertices, ear, 0.2 * width) for ear in ears))
    redness = 0.8 * _bump(vertices, marks[30], 0.10 * width)
    for point, strength, radius in [
        *((c, 0.75, 0.17) for c in cheeks),
        *((e, 0.7, 0.13) for e in ears),
        *((marks[i], 0.25, 0.08) for i in (39, 42, 36, 45)),
        (marks[8], 0.3, 0.12),
    ]:
        redness += strength * _bump(vertices, point, radius * width)
    freckles = _bump(vertices, marks[28], 0.2 * width)
    for cheek in cheeks:
        freckles += 0.9 * _bump(vertices, cheek, 0.2 * width)
    return np.stack(
        [
            subject.lip_mask,
            np.clip(redness, 0, 1),
            np.clip(freckles, 0, 1),
            _beard(vertices, marks, width) * (1 - subject.lip_mask),
            _scalp(subject) * (1 - beside),
            np.maximum(marks[[62, 66], 2].mean() - vertices[:, 2], 0),
        ],
        axis=1,
    ).astype(np.float32)


def _beard(vertices: np.ndarray, marks: np.ndarray, width: float) -> np.ndarray:
    """(V,) where a beard grows: chin, jaw and upper lip."""
    beard = np.zeros(len(vertices))
    for index in (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14):
        beard = np.maximum(beard, _bump(vertices, marks[index], 0.16 * width))
    lip = 0.5 * (marks[33] + marks[51])
    for offset in (-0.12, 0.0, 0.12):
        beside = lip + np.array([offset * width, 0, 0])
        beard = np.maximum(beard, _bump(vertices, beside, 0.07 * width))
    return np.clip(1.4 * beard, 0, 1)


def _scalp(subject: Subject) -> np.ndarray:
    """(V,) how much the roots of hair shade the skin: 1 where hair ends, falling to 0."""
    edge = hair_edge(subject)
    if len(edge) == 0:
        return np.zeros(len(subject.vertices))
    distance, _ = KDTree(subject.vertices[edge]).query(subject.vertices)
    return np.exp(-0.5 * (distance / SCALP_REACH) ** 2)


def _sky_visibility(subject: Subject, vertices: np.ndarray, size: int, reach: float) -> np.ndarray:
    """(V,) float32 cosine-weighted part of the sky that each vertex sees.

    Args:
        subject: The person.
        vertices: (V, 3) metres from the middle of the depth maps.
        size: Texels along the side of a depth map.
        reach: Half its side in metres.
    """
    solid = subject.faces[~np.isin(subject.materials, CARDS)]
    normals = vertex_normals(vertices, subject.faces)
    seen, total = np.zeros(len(vertices)), np.full(len(vertices), 1e-6)
    for direction in _sphere(DIRECTIONS):
        screen = light_screen(vertices, direction, size, reach)
        nearest, triangle, barycentric = empty_buffers(size, size)
        rasterise(screen, solid, nearest, triangle, barycentric)
        cosine = np.maximum(normals @ direction, 0)  # (V,)
        seen += cosine * _lit(screen, nearest, BIAS * 2 * reach / size)
        total += cosine
    return (WIDE + (1 - WIDE) * seen / total).astype(np.float32)


def _sphere(count: int) -> np.ndarray:
    """(count, 3) float32 directions spread evenly (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = 1 - 2 * index / count
    angle = np.pi * (1 + 5**0.5) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), height, ring * np.sin(angle)], 1).astype(np.float32)


def light_basis(direction: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, down and towards the light, for parallel light from `direction`."""
    towards = direction / np.linalg.norm(direction)
    up = np.array([0.0, 1.0, 0.0]) if abs(towards[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, -np.cross(towards, right), towards])


def light_screen(
    vertices: np.ndarray, direction: np.ndarray, size: int, reach: float
) -> np.ndarray:
    """Projects the person along parallel light, for `rasterise`.

    Args:
        vertices: (V, 3) metres relative to the centre of the depth map.
        direction: (3,) unit vector towards the light.
        size: Side of the depth map in texels.
        reach: Half the side of the depth map in metres.

    Returns:
        (V, 3) float32: x, y in texels, and metres towards the light plus 2.
    """
    screen = (vertices @ light_basis(direction).T).astype(np.float32)  # (V, 3)
    screen[:, :2] = screen[:, :2] * (size / (2 * reach)) + size / 2
    screen[:, 2] += 2.0
    return screen


@njit(cache=True, nogil=True)
def _lit(screen, nearest, bias):
    """(V,) 1 where a vertex lies at the front of the depth map, 0 where something hides it."""
    size = nearest.shape[0]
    lit = np.ones(screen.shape[0])
    for i in range(screen.shape[0]):
        x, y = int(screen[i, 0]), int(screen[i, 1])
        if x < 0 or y < 0 or x >= size or y >= size:
            continue
        if nearest[y, x] > screen[i, 2] + bias:
            lit[i] = 0.0
    return lit
