"""Glasses: two rims, a bridge and temples of a tube, and thin lenses, fixed to the skull."""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.studio.person.growing.skull import HALF_WIDTH, skull_of
from ico3d.studio.person.subject import Material, Subject

LENS = (0.0245, 0.0200)
"""Half of a lens' width and height for a face 0.13 m wide, metres."""
SQUARE = 2.8
"""Exponent of a lens' outline: 2 is an ellipse, larger ones are squarer."""
WRAP = 0.9
"""How far the front bends back around the face, metres per square metre."""
CURVE = 0.25
"""Radius of the sphere that a lens is part of, metres."""
RIM, BRIDGE, TEMPLE = 0.0017, 0.0015, 0.0018
"""Radii of the tubes, metres."""
GAP = 0.002
"""Distance of the lenses from what lies nearest behind them, metres."""
AROUND, SIDES, RINGS = 48, 8, 6


@dataclass(frozen=True)
class Patch:
    """A piece of a mesh.

    Attributes:
        vertices: (N, 3) metres.
        faces: (F, 3) int indices of its vertices.
        material: What it is made of.
    """

    vertices: np.ndarray
    faces: np.ndarray
    material: Material


def with_glasses(subject: Subject) -> Subject:
    """The person with glasses on the nose, which move with the skull alone."""
    marks = subject.landmarks(subject.vertices).astype(float)
    scale = float(np.linalg.norm(marks[16] - marks[0])) / 0.13
    middles = [np.array([1.12 * eye.centre[0], eye.centre[1] - 0.002]) for eye in subject.eyes]
    depth = _front(subject, middles, scale)
    patches = []
    for middle in middles:
        outline = _outline(middle, scale)  # (A, 2)
        patches.append(_tube(_bent(outline, depth), RIM * scale, closed=True))
        patches.append(_lens(middle, outline, depth))
    patches.append(_tube(_bridge(middles, scale, depth), BRIDGE * scale))
    for middle in middles:
        patches.append(_tube(_temple(subject, middle, scale, depth), TEMPLE * scale))
    for patch in patches:
        subject = _added(subject, patch)
    return subject


def _front(subject: Subject, middles: list[np.ndarray], scale: float) -> float:
    """Z of the lenses at the nose: before brows, lids and cheeks."""
    face = subject.vertices[np.unique(subject.faces[subject.materials == Material.SKIN])]
    near = np.zeros(len(face), bool)
    for middle in middles:
        away = np.abs(face[:, :2] - middle) / scale
        near |= (away[:, 0] < 0.6 * LENS[0]) & (away[:, 1] < 0.9 * LENS[1])
    bent = face[near, 2] + WRAP * face[near, 0] ** 2
    return float(bent.max()) + GAP * scale


def _outline(middle: np.ndarray, scale: float) -> np.ndarray:
    """(A, 2) x and y around a lens."""
    turn = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], 1)
    return middle + scale * np.array(LENS) * np.sign(circle) * np.abs(circle) ** (2 / SQUARE)


def _bent(flat: np.ndarray, depth: float) -> np.ndarray:
    """(N, 3) places (N, 2) on the front, which bends around the face."""
    return np.column_stack([flat, depth - WRAP * flat[:, 0] ** 2])


def _lens(middle: np.ndarray, outline: np.ndarray, depth: float) -> Patch:
    """Rings of a lens about its middle, slightly domed."""
    shares = np.linspace(1, 0, RINGS, endpoint=False)
    flat = np.concatenate([middle + s * (outline - middle) for s in shares] + [middle[None]])
    points = _bent(flat, depth)
    reach = np.linalg.norm(outline - middle, axis=1).max()
    points[:, 2] += (reach**2 - ((flat - middle) ** 2).sum(1)) / (2 * CURVE)
    faces = _grid(RINGS, AROUND)
    last = (RINGS - 1) * AROUND + np.arange(AROUND)
    tip = np.full(AROUND, len(points) - 1)
    fan = np.stack([last, np.roll(last, -1), tip], 1)
    return Patch(points, np.concatenate([faces, fan]), Material.LENS)


def _bridge(middles: list[np.ndarray], scale: float, depth: float) -> np.ndarray:
    """(8, 3) an arch between the lenses."""
    inner = abs(middles[0][0]) - scale * LENS[0]
    x = np.linspace(-inner, inner, 8)
    y = middles[0][1] + scale * (0.004 + 0.003 * (1 - (x / inner) ** 2))
    return _bent(np.stack([x, y], 1), depth + 0.001 * scale)


def _temple(subject: Subject, middle: np.ndarray, scale: float, depth: float) -> np.ndarray:
    """(10, 3) from a lens' outer edge over the ear and down behind it."""
    skull = skull_of(subject)
    half = HALF_WIDTH * (scale if skull is None else skull.scale) + 0.003
    side = np.sign(middle[0])
    hinge = _bent(np.array([[middle[0] + side * scale * LENS[0], middle[1] + 0.008]]), depth)[0]
    ear = np.array([side * half, middle[1] + 0.010 * scale, -0.012 * scale])
    hook = ear + scale * np.array([0, -0.022, -0.016])
    straight = hinge + np.linspace(0, 1, 7)[:, None] * (ear - hinge)
    return np.concatenate([straight, ear + np.linspace(0, 1, 4)[1:, None] * (hook - ear)])


def _tube(line: np.ndarray, radius: float, closed: bool = False) -> Patch:
    """A tube along a line (N, 3)."""
    ahead = np.roll(line, -1, 0) - np.roll(line, 1, 0) if closed else np.gradient(line, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    up = np.where(np.abs(ahead[:, 2:]) < 0.8, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    across = np.cross(ahead, up)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beside = np.cross(ahead, across)
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)[None, :, None]
    ring = np.cos(turn) * across[:, None] + np.sin(turn) * beside[:, None]  # (N, S, 3)
    points = (line[:, None] + radius * ring).reshape(-1, 3)
    rows = len(line) + closed
    return Patch(points, _grid(rows, SIDES) % len(points), Material.FRAME)


def _grid(rows: int, columns: int) -> np.ndarray:
    """(F, 3) faces of rows of vertices whose ends meet."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b = index[:-1], np.roll(index[:-1], -1, 1)
    c, d = np.roll(index[1:], -1, 1), index[1:]
    return np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )


def _added(subject: Subject, patch: Patch) -> Subject:
    """The person with a patch that no expression moves, and that is carried as the crown is."""
    count, new = len(subject.vertices), len(patch.vertices)
    crown = np.full(new, int(subject.vertices[:, 1].argmax()))
    carried = np.append(np.arange(count), crown)
    made = np.full(len(patch.faces), patch.material, np.uint8)
    uv = np.zeros((len(patch.faces), 3, 2), np.float32)
    return replace(
        subject,
        vertices=np.concatenate([subject.vertices, patch.vertices]).astype(np.float32),
        faces=np.concatenate([subject.faces, patch.faces + count]).astype(np.int32),
        materials=np.concatenate([subject.materials, made]),
        corner_uv=np.concatenate([subject.corner_uv, uv]),
        lip_mask=np.concatenate([subject.lip_mask, np.zeros(new, np.float32)]),
        skeleton=subject.skeleton and subject.skeleton.of(carried),
    )
