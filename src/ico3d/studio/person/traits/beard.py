"""A full beard: strands on chin, jaw and upper lip, which move with the jaw."""

from dataclasses import replace

import numpy as np

from ico3d.studio.person.growing.styles import clumped, unit, waves
from ico3d.studio.person.scatter import areas, scattered
from ico3d.studio.person.strands import bound, joined
from ico3d.studio.person.subject import Material, Subject
from ico3d.studio.raster import vertex_normals

HAIRS, POINTS = 15_000, 6
RADIUS = 0.00012
"""Half of a hair's thickness, metres."""
LENGTH, MOUSTACHE = 0.018, 0.009
"""Lengths of hairs at the chin and above the lips, metres."""
UNDER = 0.75
"""How far the roots darken the skin, as `Look.stubble` does."""


def beard_share(vertices: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """(V,) how much a beard grows at vertices (V, 3), 0 to 1: chin, jaw and upper lip.

    Args:
        vertices: (V, 3) metres.
        marks: (68, 3) Multi-PIE landmarks, metres.
    """
    width = float(np.linalg.norm(marks[16] - marks[0]))  # of the face, about 0.13 m
    beard = np.zeros(len(vertices))
    for index in (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14):
        beard = np.maximum(beard, bump(vertices, marks[index], 0.16 * width))
    lip = 0.5 * (marks[33] + marks[51])
    for offset in (-0.12, 0.0, 0.12):
        beside = lip + np.array([offset * width, 0, 0])
        beard = np.maximum(beard, bump(vertices, beside, 0.07 * width))
    return np.clip(1.4 * beard, 0, 1)


def bump(vertices: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """(V,) a smooth hill of height 1 about a point."""
    distance = ((vertices - centre) ** 2).sum(axis=1)
    return np.exp(-distance / (2 * radius**2))


def bearded(subject: Subject) -> Subject:
    """The person with a full beard of the colour of their hair."""
    random = np.random.default_rng(11)
    corners, parts = _roots(subject, random)
    at = subject.vertices[corners].astype(float)  # (N, 3, 3)
    roots = np.einsum("nk,nkc->nc", parts, at)
    normals = vertex_normals(subject.vertices, subject.faces)[corners]  # (N, 3, 3)
    outwards = unit(np.einsum("nk,nkc->nc", parts, normals.astype(float)))
    marks = subject.landmarks(subject.vertices).astype(float)
    above = roots[:, 1] > marks[[48, 54], 1].mean() + 0.002  # the moustache, and the cheeks' edge
    above &= np.abs(roots[:, 0]) < 1.2 * np.abs(marks[[48, 54], 0]).mean()
    aside = np.clip(roots[:, 0] / 0.02, -1, 1) * above
    down = np.stack([0.9 * aside, -np.ones(len(roots)), 0.1 * np.ones(len(roots))], 1)
    lift = np.where(above, 0.25, 0.45)[:, None]
    way = unit(unit(down) + lift * outwards + random.normal(0, 0.12, roots.shape))
    high = np.clip((roots[:, 1] - marks[8, 1]) / (marks[2, 1] - marks[8, 1]), 0, 1)  # (N,)
    length = np.where(above, MOUSTACHE, LENGTH * (1 - 0.65 * high))
    length = (length * random.uniform(0.6, 1.1, len(roots)))[:, None, None]
    t = np.linspace(0, 1, POINTS)[None, :, None]
    points = roots[:, None] + length * (t * way[:, None] + 0.12 * t**2 * [0, -1.0, 0])
    points = clumped(points, 0.2, 1400, 0.35)
    points += 0.0009 * waves(len(roots), POINTS, 0.8, random)
    grown = bound(
        subject.vertices,
        corners,
        parts,
        points - 0.0006 * outwards[:, None],
        np.linspace(0.45, 1.0, POINTS),
        RADIUS * (1 - 0.75 * np.linspace(0, 1, POINTS) ** 2),
        np.exp(random.normal(0, 0.3, len(roots))),
        int(Material.HAIR),
    )
    others = [] if subject.strands is None else [subject.strands]
    look = replace(subject.look, stubble=UNDER)
    return replace(subject, strands=joined([*others, grown]), look=look)


def _roots(subject: Subject, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3) and places on them (N, 3): evenly over where a beard grows."""
    marks = subject.landmarks(subject.vertices)
    share = beard_share(subject.vertices, marks) * (subject.lip_mask < 0.05)  # (V,)
    x, y, z = subject.vertices.T
    nose = (y > marks[33, 1] - 0.003) & (np.abs(x) < 1.5 * np.abs(marks[[31, 35], 0]).max())
    bare = nose | (z < marks[0, 2] - 0.02)
    skin = subject.faces[subject.materials == Material.SKIN]
    skin = skin[(share * ~bare)[skin].min(axis=1) > 0.05]
    area = areas(subject.vertices[skin].astype(float))  # (F,)
    chosen, parts = scattered(area, 3 * HAIRS, random)
    dense = np.einsum("nk,nk->n", parts, share[skin[chosen]]) ** 1.5
    kept = np.flatnonzero(random.random(3 * HAIRS) < dense)[:HAIRS]
    return skin[chosen[kept]], parts[kept]
