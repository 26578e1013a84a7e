"""Grows brows and lashes where a mesh has cards for them, or along its landmarks."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from ico3d.studio.person.growing.styles import smooth, unit
from ico3d.studio.person.scatter import areas, scattered
from ico3d.studio.person.strands import Strands, bound
from ico3d.studio.person.subject import Material, Subject

BROW_HAIRS, LASH_HAIRS = 800, 210
"""Hairs of one brow, and lashes of one lid."""
BROW_RADIUS, LASH_RADIUS = 0.000065, 0.000065
"""Half of the thickness of hairs, metres."""
LOWERED = 0.0064, 0.0046, 0.0037
"""Metres by which brows grow below their cards: near the nose, in the middle, outside."""
FULLER = 0.40
"""Height that brows have beyond that of their cards, as a share of it."""
POINTS = 5
UPPER_LIDS = ((39, 38, 37, 36), (42, 43, 44, 45))
"""Landmarks along the upper lids, from the nose outwards."""
LOWER = 1.5
"""Lashes beyond this u grow on the lower lid."""


def brows(subject: Subject, random: np.random.Generator) -> Strands | None:
    """Hairs of both brows, which leave the skin upwards near the nose and lie flat outside."""
    sampled = _on_cards(subject, Material.BROW, 5 * BROW_HAIRS, random)
    if sampled is None:
        return None
    _, places, uv, along, up = sampled
    u, v = uv.T
    ends = smooth(-0.02, 0.16, u) * (1 - smooth(0.80, 1.0, u))
    edges = smooth(0.02, 0.34, v) * (1 - smooth(0.52, 0.92, v))
    kept = np.flatnonzero(random.random(len(u)) < ends * edges)[: 2 * BROW_HAIRS]
    places, u, v, along, up = places[kept], u[kept], v[kept], unit(along[kept]), up[kept]
    lower = np.interp(u, [0, 0.5, 1.0], LOWERED)
    places = places + FULLER * (v - 0.45)[:, None] * up - lower[:, None] * unit(up)
    up = unit(up - along * (up * along).sum(1, keepdims=True))
    out = np.cross(along, up)
    out *= np.sign(out[:, 2:])
    corners = _nearest_skin(subject, places)
    places = _on_planes(subject.vertices[corners].astype(float), places)
    count = len(u)
    angle = np.interp(u, [0, 0.12, 0.3, 0.6, 1.0], [80.0, 58.0, 30.0, 8.0, -14.0])
    angle = np.radians(angle + 34 * (0.45 - v) + random.normal(0, 7, count))
    length = np.interp(u, [0, 0.2, 0.6, 1.0], [0.0050, 0.0072, 0.0072, 0.0050])
    length = (length * random.uniform(0.6, 1.1, count))[:, None, None]
    t = np.linspace(0, 1, POINTS)[None, :, None]
    bent = angle[:, None] - 0.35 * t[..., 0]  # (N, K): hairs bend outwards
    lies = np.cos(bent)[..., None] * along[:, None] + np.sin(bent)[..., None] * up[:, None]
    points = places[:, None] + length * (t * lies + (0.30 * t - 0.26 * t**2) * out[:, None])
    points -= 0.0002 * out[:, None]
    tone = np.exp(random.normal(0, 0.25, count))
    radius = np.full(count, BROW_RADIUS)
    return _grown(subject, corners, points, radius, Material.BROW, tone)


def lashes(subject: Subject, random: np.random.Generator) -> Strands:
    """Lashes of both eyes: dense and bent upwards on the upper lid, short and pale below.

    Tips stand together in small groups.
    """
    sampled = _on_cards(subject, Material.LASH, 40 * LASH_HAIRS, random)
    if sampled is None:
        corners, roots, ways, lower = _along_lids(subject, random)
    else:
        corners, places, uv, _, ways = sampled
        kept = np.flatnonzero(uv[:, 1] < 0.2)
        kept = kept[: 4 * LASH_HAIRS]
        corners, ways = corners[kept], ways[kept]
        roots = places[kept] - uv[kept, 1:] * ways
        lower = uv[kept, 0] > LOWER
    count = len(roots)
    length = np.where(lower, 0.0026, 0.0082) * random.uniform(0.55, 1.1, count)
    curl = np.where(lower, -0.35, 0.85)[:, None, None] * np.array([0.0, 1.0, 0.15])
    ways = unit(unit(ways) + random.normal(0, 0.10, (count, 3)))
    t = np.linspace(0, 1, POINTS)[None, :, None]
    points = roots[:, None] + length[:, None, None] * (t * ways[:, None] + 0.5 * curl * t**2)
    guides = random.permutation(count)[: max(1, count // 5)]
    nearest = guides[KDTree(points[guides, 0]).query(points[:, 0])[1]]
    points += 0.45 * t**2 * (points[nearest, -1:] - points[:, -1:])
    tone = np.where(lower, 2.6, 1.0) * np.exp(random.normal(0, 0.25, count))
    radius = np.where(lower, 0.55, 1.0) * LASH_RADIUS
    return _grown(subject, corners, points, radius, Material.LASH, tone)


def _grown(
    subject: Subject,
    corners: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    material: Material,
    tone: np.ndarray,
) -> Strands:
    taper = radius[:, None] * (1 - 0.8 * np.linspace(0, 1, POINTS) ** 1.5)
    return bound(
        subject.vertices,
        corners,
        np.full((len(corners), 3), 1 / 3),
        points,
        np.linspace(0.75, 1.0, POINTS),
        taper,
        tone,
        int(material),
    )


def _on_cards(
    subject: Subject, material: Material, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Random places on cards: triangles (N, 3), places (N, 3), uv (N, 2), metres per u and per v.

    None without cards of this material.
    """
    chosen = np.flatnonzero(subject.materials == material)
    if len(chosen) == 0:
        return None
    corners = subject.vertices[subject.faces[chosen]].astype(float)  # (F, 3, 3)
    uv = subject.corner_uv[chosen].astype(float)  # (F, 3, 2)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = areas(corners)  # (F,)
    determinant = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
    area[np.abs(determinant) < 1e-12] = 0
    f, parts = scattered(area, count, random)
    inverse = 1 / determinant[f, None]
    return (
        subject.faces[chosen[f]],
        np.einsum("nk,nkc->nc", parts, corners[f]),
        np.einsum("nk,nkc->nc", parts, uv[f]),
        (e1[f] * d2[f, 1:] - e2[f] * d1[f, 1:]) * inverse,
        (e2[f] * d1[f, :1] - e1[f] * d2[f, :1]) * inverse,
    )


def _along_lids(
    subject: Subject, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Triangles, roots and directions (N, 3), and whether lower (N,), along the upper lids."""
    marks = subject.landmarks(subject.vertices).astype(float)
    roots, ways = [], []
    for lid in UPPER_LIDS:
        t = random.uniform(0.06, 1.0, 2 * LASH_HAIRS)
        roots.append(CubicSpline(np.linspace(0, 1, 4), marks[list(lid)])(t))
        side = np.sign(marks[lid[3], 0])
        aside = side * (0.9 * t - 0.25)
        ways.append(np.stack([aside, 0.15 + 0 * t, np.ones_like(t)], 1))
    places = np.concatenate(roots)
    corners = _nearest_skin(subject, places)
    return corners, places, np.concatenate(ways), np.zeros(len(places), bool)


def _nearest_skin(subject: Subject, places: np.ndarray) -> np.ndarray:
    """(N, 3) vertices of the triangle of skin next to each place (N, 3)."""
    skin = subject.faces[subject.materials == Material.SKIN]
    return skin[KDTree(subject.vertices[skin].mean(axis=1)).query(places)[1]]


def _on_planes(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(N, 3) where places (N, 3) meet the planes of triangles (N, 3, 3) next to them."""
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    away = ((places - corners.mean(axis=1)) * normals).sum(axis=1, keepdims=True)
    return places - away * normals
