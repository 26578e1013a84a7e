"""Grows a person's hair as strands, always the same for the same person."""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ico3d.studio.person.growing import face, fringe, styles, tied, wisps
from ico3d.studio.person.growing.skull import Skull, skull_of
from ico3d.studio.person.scatter import areas, scattered
from ico3d.studio.person.strands import Strands, bound, joined
from ico3d.studio.person.subject import CARDS, Material, Subject
from ico3d.studio.raster import vertex_normals

LONG, SHORT = 14000, 28000
"""Strands on a head, of long and of short hair."""
LOOSE = 20000
"""Strands of long hair that falls on the shoulders."""
TAIL = 3600
"""Strands in a tail."""
BABY_HAIRS, FLYAWAYS = 2600, 160
"""Short hairs at the hairline of tied hair, and strands that leave its surface."""
RADIUS = 0.00013
"""Half of a strand's thickness in metres: thicker than real hair, which is more numerous."""
FRINGE = 2600
"""Strands of a fringe."""
EDGE = 0.015
"""Metres over which the hairline thins out: the strands there are fewer and finer."""
AWAY = 0.03
"""Hair farther than this from the skin hangs in a tail, metres."""

FREE_TAIL = (
    (0.10, -0.995),
    (0.004, -0.022),
    (-0.006, -0.040),
    (-0.030, -0.052),
    (-0.065, -0.055),
    (-0.110, -0.050),
    (-0.160, -0.044),
    (-0.205, -0.042),
)
"""A tail of its own: direction (y, z) of the tie from the skull's centre, then places relative to
the skin there, metres."""


def with_hair(subject: Subject, loose: bool = False) -> Subject:
    """The person with strands instead of the mesh that stood for hair; bald ones stay bald.

    Args:
        subject: The person.
        loose: Whether the hair falls on the shoulders; else men's is cropped, women's tied.
    """
    skull = skull_of(subject)
    if skull is None or not (subject.materials == Material.HAIR).any():
        return subject
    random = np.random.default_rng(7)
    count = SHORT if subject.male and not loose else LOOSE if loose else LONG
    corners, parts = _roots(subject, skull, count, random)
    roots = np.einsum("nk,nkc->nc", parts, subject.vertices[corners])
    grown = []
    if loose:
        paths = styles.loose(skull, roots, _skin_and_cloth(subject), random)
    elif not subject.male:
        line, width = _tail_line(subject, skull)
        paths = tied.tied(skull, roots, line[0], random)
        hanging = tied.tail(line, width, TAIL, random)
        near = np.argsort(np.linalg.norm(roots - line[0], axis=1))[:300]
        where = random.choice(near, TAIL)
        grown.append(
            _of(subject, corners[where], parts[where], hanging, np.full(TAIL, 1.0), random)
        )
        grown += _escaped(subject, skull, corners, parts, paths, random)
    else:
        paths = styles.short(skull, roots, random)
    grown.append(_of(subject, corners, parts, paths, skull.inside_hairline(roots), random))
    brows = face.brows(subject, random)
    if brows is not None:
        grown.append(brows)
    grown.append(face.lashes(subject, random))
    bare = ~np.isin(subject.materials, (Material.HAIR, *CARDS))
    return replace(
        subject,
        faces=subject.faces[bare],
        materials=subject.materials[bare],
        corner_uv=subject.corner_uv[bare],
        strands=joined(grown),
    )


def _escaped(
    subject: Subject,
    skull: Skull,
    corners: np.ndarray,
    parts: np.ndarray,
    combed: styles.Paths,
    random: np.random.Generator,
) -> list[Strands]:
    """What tied hair of roots (N, 3), (N, 3) does not hold: baby hairs and flyaways."""
    roots = np.einsum("nk,nkc->nc", parts, subject.vertices[corners])
    ways = styles.unit(combed.points[:, 2] - combed.points[:, 0])
    skin, at, places = _scalp(subject, skull, 20 * BABY_HAIRS, random)
    dense = wisps.near_edge(skull.inside_hairline(places) + 0.005 * _ripple(places))
    kept = np.flatnonzero(random.random(len(places)) < dense)[:BABY_HAIRS]
    like = KDTree(roots).query(places[kept])[1]
    groups = [(skin[kept], at[kept], wisps.baby(skull, places[kept], ways[like], random))]
    high = np.flatnonzero((combed.depth[:, -4] < 0.3) & (roots[:, 1] > 0.03 * skull.scale))
    kept = random.choice(high, FLYAWAYS)
    groups.append((corners[kept], parts[kept], wisps.flyaways(skull, combed.points[kept], random)))
    kept = np.flatnonzero(fringe.belongs(skull, places))
    kept = random.choice(kept, min(FRINGE, len(kept)), replace=False)
    groups.append((skin[kept], at[kept], fringe.curtain(skull, places[kept], random)))
    return [_of(subject, c, p, w, np.full(len(c), 1.0), random) for c, p, w in groups]


def _scalp(
    subject: Subject, skull: Skull, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (N, 3), weights (N, 3) and places (N, 3), evenly over the scalp and its edge."""
    skin = subject.faces[subject.materials == Material.SKIN]
    skin = skin[skull.inside_hairline(subject.vertices[skin].mean(axis=1)) > -0.015]
    at = subject.vertices[skin].astype(float)  # (F, 3, 3)
    chosen, parts = scattered(areas(at), count, random)
    return skin[chosen], parts, np.einsum("nk,nkc->nc", parts, at[chosen])


def _skin_and_cloth(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) and normals (N, 3) of what hair lies on."""
    worn = np.isin(subject.materials, (Material.SKIN, Material.CLOTH))
    on = np.unique(subject.faces[worn])
    return subject.vertices[on], vertex_normals(subject.vertices, subject.faces)[on]


def _of(
    subject: Subject,
    corners: np.ndarray,
    parts: np.ndarray,
    paths: styles.Paths,
    inside: np.ndarray,
    random: np.random.Generator,
) -> Strands:
    """Binds hair whose roots lie `inside` (N,) metres from the hairline, where it is finer."""
    tone = paths.tone
    if tone is None:
        tone = np.exp(random.normal(0, 0.22, len(corners)))
    fine = 0.35 + 0.65 * styles.smooth(-0.004, EDGE, inside)
    return bound(
        subject.vertices,
        corners,
        parts,
        paths.points,
        np.exp(-1.9 * paths.depth),
        RADIUS * paths.taper * fine[:, None],
        tone,
        int(Material.HAIR),
    )


def _roots(
    subject: Subject, skull: Skull, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3) and places on them (N, 3): evenly over the scalp, thinner at its edge."""
    corners, parts, places = _scalp(subject, skull, 2 * count, random)
    depth = skull.inside_hairline(places) + 0.004 * _ripple(places)
    dense = np.clip(0.35 + depth / EDGE, 0, 1) ** 1.5  # (N,)
    kept = np.flatnonzero(random.random(len(places)) < dense)[:count]
    return corners[kept], parts[kept]


def _ripple(places: np.ndarray) -> np.ndarray:
    """(N,) an uneven line, about -1 to 1."""
    x, y, z = places.T
    return 0.6 * np.sin(210 * x + 60 * z) + 0.4 * np.sin(470 * x - 330 * z + 200 * y)


def _tail_line(subject: Subject, skull: Skull) -> tuple[np.ndarray, np.ndarray]:
    """Middle (L, 3) and radius (L,) of a tail: of the hair mesh's, or of one that falls freely."""
    hair = subject.vertices[np.unique(subject.faces[subject.materials == Material.HAIR])]
    skin = subject.vertices[np.unique(subject.faces[subject.materials == Material.SKIN])]
    away = hair[KDTree(skin).query(hair)[0] > AWAY]
    if len(away) > 0.1 * len(hair):
        levels = np.linspace(away[:, 1].max() - 0.01, away[:, 1].min() + 0.01, 12)
        slices = [away[np.abs(away[:, 1] - level) < 0.014] for level in levels]
        line = np.array([np.median(s, axis=0) for s in slices])
        width = np.array([1.1 * s[:, [0, 2]].std(axis=0).mean() + 0.003 for s in slices])
    else:
        first = skull.on(np.array([[0.0, *FREE_TAIL[0]]]), np.zeros(1))
        line = first + np.array([[0.0, y, z] for y, z in FREE_TAIL[1:]]) * skull.scale
        width = np.interp(np.linspace(0, 1, len(line)), [0, 0.35, 1], [0.012, 0.021, 0.007])
    tie = skull.on(styles.unit(line[:1] - skull.centre), np.array([0.010]))  # (1, 3)
    line, width = np.concatenate([tie, line]), np.concatenate([[0.010], width])
    for _ in range(2):  # hair bends in an arc where a mesh has a corner
        line[1:-1] = 0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:])
    width[1] = max(width[1], 0.014)
    return line, width
