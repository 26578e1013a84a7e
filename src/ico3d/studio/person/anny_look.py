"""Additions to the body model `anny` for recordings: landmarks, visemes, lips, brows and hair."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import KDTree

from ico3d.studio.person.smooth import smoothed
from ico3d.studio.person.subject import Look, Material, Subject
from ico3d.studio.raster import vertex_normals

# fmt: off
LANDMARKS = (
    871, 5411, 5530, 5241, 894, 749, 995, 727, 747, 7449, 7689, 7468, 7596, 11850, 12129, 12010,
    7576,
    3742, 207, 206, 1233, 208, 6983, 7925, 6981, 6982, 10410,
    133, 5063, 291, 5054, 354, 313, 317, 7076, 7115,
    6781, 4849, 4865, 4871, 4862, 1350, 11489, 11483, 11467, 13377, 8042, 11480,
    3736, 550, 460, 466, 7219, 7293, 10404, 7235, 7241, 5337, 486, 480,
    3732, 472, 520, 7228, 10400, 7264, 540, 517,
)
# fmt: on
"""Vertices of the base mesh nearest to the Multi-PIE landmarks that face trackers use."""

LOOK = Look(
    skin=(0.30, 0.160, 0.100),
    lips=(0.30, 0.095, 0.085),
    hair=(0.014, 0.009, 0.007),
    iris=(0.085, 0.042, 0.020),
    cloth=((0.36, 0.125, 0.045), (0.50, 0.40, 0.25)),
    stripes=True,
    freckles=0.1,
    jumper=(0.42, 0.235, 0.075),
    stubble=0.0,
)


def _both(name: str, weight: float) -> dict[str, float]:
    return {f"{name}Left": weight, f"{name}Right": weight}


VISEMES: dict[str, dict[str, float]] = {
    "sil": {},
    "PP": {"mouthRollLower": 0.3, "mouthRollUpper": 0.2, **_both("mouthPress", 0.5)},
    "FF": {"jawOpen": 0.05, "mouthRollLower": 0.5, **_both("mouthUpperUp", 0.4)},
    "TH": {"jawOpen": 0.14, "tongueOut": 0.4, **_both("mouthLowerDown", 0.25)},
    "DD": {"jawOpen": 0.14, **_both("mouthLowerDown", 0.3), **_both("mouthUpperUp", 0.15)},
    "kk": {"jawOpen": 0.17, **_both("mouthLowerDown", 0.2), **_both("mouthStretch", 0.15)},
    "CH": {"jawOpen": 0.10, "mouthFunnel": 0.6, **_both("mouthUpperUp", 0.1)},
    "SS": {"jawOpen": 0.05, **_both("mouthLowerDown", 0.35), **_both("mouthStretch", 0.35)},
    "nn": {"jawOpen": 0.10, **_both("mouthLowerDown", 0.25), **_both("mouthUpperUp", 0.1)},
    "RR": {"jawOpen": 0.13, "mouthFunnel": 0.3, "mouthPucker": 0.3},
    "aa": {"jawOpen": 0.48, **_both("mouthLowerDown", 0.2), **_both("mouthUpperUp", 0.15)},
    "E": {"jawOpen": 0.26, **_both("mouthStretch", 0.35), **_both("mouthUpperUp", 0.2)},
    "ih": {"jawOpen": 0.16, **_both("mouthStretch", 0.3), **_both("mouthSmile", 0.15)},
    "oh": {"jawOpen": 0.32, "mouthFunnel": 0.6, "mouthPucker": 0.2},
    "ou": {"jawOpen": 0.12, "mouthFunnel": 0.25, "mouthPucker": 0.75},
}
"""Visemes as weights of facial actions, tuned by hand."""

BROW_WIDTH = 0.009
HAIRLINE_ANGLE = np.radians([0.0, 40.0, 68.0, 84.0, 100.0, 130.0, 180.0])
HAIRLINE_HEIGHT = np.array([0.066, 0.058, 0.036, -0.012, 0.012, -0.045, -0.070])
"""Height of the hairline above the eyes in metres, for each of `HAIRLINE_ANGLE` from the front."""
HAIR_DEPTH = 0.020
SKULL = np.array([0.0, 0.020, -0.005])
SKULL_HALF_WIDTH = 0.074
EAR, EAR_RADIUS = np.array([0.075, -0.010, -0.012]), 0.034
CROWN = np.array([0.0, 0.85, -0.5])


def finished(subject: Subject) -> Subject:
    """Smooths the person's mesh and adds lips, brows and hair."""
    smooth = smoothed(subject, np.ones(len(subject.faces), bool))
    smooth = replace(smooth, lip_mask=_lip_mask(smooth))
    for side in (range(21, 16, -1), range(22, 27)):
        smooth = _with_brow(smooth, list(side))
    return _with_hair(smooth)


def _lip_mask(subject: Subject) -> np.ndarray:
    """(V,) 1 between the outer landmarks of the lips, soft at the rim."""
    marks = subject.landmarks(subject.vertices)
    upper = marks[48:55]
    lower = marks[[48, 59, 58, 57, 56, 55, 54]]
    x, y, z = subject.vertices.T
    top = np.interp(x, upper[:, 0], upper[:, 1])
    bottom = np.interp(x, lower[:, 0], lower[:, 1])
    inside = np.minimum(top - y, y - bottom)
    inside = np.minimum(inside, 0.6 * (marks[54, 0] - np.abs(x)))
    front = z > marks[48, 2] - 0.012
    return (np.clip(inside / 0.0016 + 0.5, 0, 1) * front).astype(np.float32)


def _appended(
    subject: Subject,
    vertices: np.ndarray,
    faces: np.ndarray,
    corner_uv: np.ndarray,
    material: Material,
    like: np.ndarray,
) -> Subject:
    """Adds a patch (N vertices, G faces) that moves as the vertices `like` (N,) do."""
    count = len(subject.vertices)
    row = np.full(count, -1)
    row[subject.delta_vertices] = np.arange(len(subject.delta_vertices))
    moved = np.flatnonzero(row[like] >= 0)
    return replace(
        subject,
        vertices=np.concatenate([subject.vertices, vertices]).astype(np.float32),
        faces=np.concatenate([subject.faces, faces + count]).astype(np.int32),
        materials=np.concatenate([subject.materials, np.full(len(faces), material, np.uint8)]),
        corner_uv=np.concatenate([subject.corner_uv, corner_uv]).astype(np.float32),
        lip_mask=np.concatenate([subject.lip_mask, np.zeros(len(vertices), np.float32)]),
        delta_vertices=np.concatenate([subject.delta_vertices, count + moved]).astype(np.int32),
        deltas=np.concatenate([subject.deltas, subject.deltas[:, row[like[moved]]]], axis=1),
        skeleton=subject.skeleton and subject.skeleton.of(np.append(np.arange(count), like)),
    )


def _with_brow(subject: Subject, landmarks: list[int]) -> Subject:
    """Lays a card of brow hairs over five landmarks, from the nose outwards."""
    line = subject.landmarks(subject.vertices)[landmarks]  # (5, 3)
    along = np.linspace(0, 1, 17)
    curve = np.polyfit(np.linspace(0, 1, 5), line, 2)  # (3, 3)
    middle = np.stack([along**2, along, np.ones_like(along)], 1) @ curve  # (17, 3)
    middle[:, 1] += 0.002 * np.sin(np.pi * along) + 0.002
    width = BROW_WIDTH * (1 - 0.45 * along)
    across = np.linspace(-0.5, 0.5, 5)
    grid = np.repeat(middle[:, None], 5, axis=1)  # (17, 5, 3)
    grid[..., 1] += width[:, None] * across
    normals = vertex_normals(subject.vertices, subject.faces)
    skin = np.unique(subject.faces[subject.materials == Material.SKIN])
    skin = skin[(normals[skin, 2] > 0.0) & (subject.vertices[skin, 2] > 0.05)]
    points = grid.reshape(-1, 3)
    surface = LinearNDInterpolator(subject.vertices[skin, :2], subject.vertices[skin, 2])
    points[:, 2] = surface(points[:, :2]) + 0.003
    like = skin[KDTree(subject.vertices[skin]).query(points)[1]]
    faces, uv = _grid_faces(17, 5)
    return _appended(subject, points, faces, uv, Material.BROW, like)


def _grid_faces(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Faces (F, 3) of a grid and their texture coordinates (F, 3, 2) in [0, 1]."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    uv = np.stack([faces // columns / (rows - 1), faces % columns / (columns - 1)], axis=-1)
    return faces, uv


def _with_hair(subject: Subject) -> Subject:
    """Grows short hair: a copy of the scalp, lifted the more the farther from the hairline."""
    depth = _inside_hairline(subject.vertices)
    scalp = (subject.materials == Material.SKIN) & (depth[subject.faces] > 0).all(axis=1)
    like, faces = np.unique(subject.faces[scalp], return_inverse=True)
    faces = faces.reshape(-1, 3)
    points = subject.vertices[like].astype(float)
    outwards = points - SKULL
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    lift = np.clip(depth[like] / 0.035, 0, 1)
    turn = np.arctan2(points[:, 0], points[:, 2])
    waves = 1 + 0.10 * np.sin(9 * turn + 40 * points[:, 1]) + 0.06 * np.sin(17 * turn)
    points += outwards * (0.0008 + HAIR_DEPTH * lift**0.8 * waves)[:, None]
    uv = _crown_uv(points[faces])
    return _appended(subject, points, faces, uv, Material.HAIR, like)


def _inside_hairline(vertices: np.ndarray) -> np.ndarray:
    """(V,) metres from the hairline; negative on face, ears and neck."""
    x, y, z = vertices.T
    angle = np.arctan2(np.abs(x), z - SKULL[2])
    step = np.radians(3)
    above, below = (np.interp(angle + d, HAIRLINE_ANGLE, HAIRLINE_HEIGHT) for d in (step, -step))
    steepness = (above - below) / (2 * step * SKULL_HALF_WIDTH)
    depth = (y - 0.5 * (above + below)) / np.hypot(1, steepness)
    from_ear = np.linalg.norm(np.stack([np.abs(x), y, z], 1) - EAR, axis=1) - EAR_RADIUS
    beside = (np.abs(x) > SKULL_HALF_WIDTH) & (y < 0.03)
    return np.where(beside, -1.0, np.minimum(depth, from_ear))


def _crown_uv(corners: np.ndarray) -> np.ndarray:
    """(F, 3, 2) texture coordinates of strands that run down from the crown."""
    axis = CROWN / np.linalg.norm(CROWN)
    side = np.array([1.0, 0.0, 0.0])
    front = np.cross(side, axis)
    local = corners - SKULL
    radius = np.linalg.norm(local, axis=-1)
    polar = np.arccos(np.clip(local @ axis / radius, -1, 1))
    turn = np.arctan2(local @ side, local @ front) / (2 * np.pi)
    turn += np.where(turn - turn[:, :1] > 0.5, -1, 0) + np.where(turn - turn[:, :1] < -0.5, 1, 0)
    return np.stack([turn, 0.2 * polar], axis=-1)
