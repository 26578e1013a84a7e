"""Cuts a flared skirt for a person: a grid of threads that hangs from the waist."""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.studio.dress.fabric import BEND, DENSITY, SHEAR, STRETCH, THICKNESS, Cloth
from ico3d.studio.dress.limbs import Section, hip_sections
from ico3d.studio.person.subject import Subject

COLUMNS = 60
THREAD = 0.02
"""Distance between two rows of the grid, metres."""
FLARE = 0.4
"""Growth of the skirt's radius per metre downwards, metres."""
EASE = 0.009
"""Gap in metres between the waistband and the distance at which cloth touches the body."""
BELOW_KNEE = 0.03
"""Metres by which the hem lies below the knee while the skirt stands off like a bell."""


@dataclass(frozen=True)
class Skirt:
    """A skirt at rest; the waistband is the first row of its points.

    Attributes:
        cloth: The cloth to simulate; point r · `columns` + c lies in row r, and columns go around.
        columns: Number of points per row.
        faces: (F, 3) int32 triangles of points, counter-clockwise seen from outside.
        corner_uv: (F, 3, 2) float32 texture coordinates: 0 to 1 once around, metres below the
            waist.
    """

    cloth: Cloth
    columns: int
    faces: np.ndarray
    corner_uv: np.ndarray


def cut_skirt(subject: Subject, columns: int = COLUMNS) -> Skirt:
    """Cuts a skirt for a whole person.

    Args:
        subject: The person at rest.
        columns: Number of points per row.

    Raises:
        SettingsError: If the subject is a bust, or the mesh has nothing at the waist.
    """
    bones = subject.skeleton
    sections = hip_sections(subject)
    waist = sections[0]
    assert bones is not None  # else there would be no sections
    knee = float(bones.at[bones.index("lowerleg01.L"), 1])
    drop = waist.height - knee + BELOW_KNEE
    rows = 1 + round(drop * np.hypot(1, FLARE) / THREAD)
    down = np.linspace(0, drop, rows)
    points = _bell(replace(waist, radius=waist.radius + _room(sections)), down, columns)
    faces, corner_uv = _woven(rows, columns, down * np.hypot(1, FLARE))
    return Skirt(_cloth(points, faces, rows, columns), columns, faces, corner_uv)


def _room(sections: list[Section]) -> float:
    """Metres by which a waistband stands off, so that the bell is wide enough at all sections."""
    waist, room = sections[0], 0.0
    for section in sections[1:]:
        deeper = section.radius - waist.radius + abs(section.middle - waist.middle)
        wider = section.radius + section.half_length - waist.radius - waist.half_length
        room = max(room, max(deeper, wider) - FLARE * (waist.height - section.height))
    return room


def _bell(waist: Section, down: np.ndarray, columns: int) -> np.ndarray:
    """(R · columns, 3) a stadium at the waist that grows alike all around on its way down."""
    ring, outward = _ring(waist, columns)
    points = ring[None] + FLARE * down[:, None, None] * outward[None]  # (R, columns, 3)
    points[..., 1] -= down[:, None]
    return points.reshape(-1, 3)


def _ring(waist: Section, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Points around a waist, and evenly spread unit directions outward, (columns, 3) both.

    They go at even distances from the front to the person's left.
    """
    radius = waist.radius + THICKNESS + EASE
    turn = 2 * np.pi * np.arange(columns) / columns
    fine = np.linspace(0, 2 * np.pi, 4096)
    x = radius * np.sin(fine) + waist.half_length * np.clip(1e6 * np.sin(fine), -1, 1)
    z = radius * np.cos(fine)
    length = np.append(0, np.cumsum(np.hypot(np.diff(x), np.diff(z))))
    at = length[-1] * np.arange(columns) / columns
    ring = np.stack(
        [
            np.interp(at, length, x),
            np.full(columns, waist.height),
            waist.middle + np.interp(at, length, z),
        ],
        1,
    )
    return ring, np.stack([np.sin(turn), np.zeros(columns), np.cos(turn)], 1)


def _woven(rows: int, columns: int, down: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (F, 3) int32 between rows, and their texture coordinates (F, 3, 2) float32."""
    row, column = (i.ravel() for i in np.mgrid[: rows - 1, :columns])
    beside = np.stack([column, column + 1], 1)  # (Q, 2); the last one closes the round
    corners = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    at = [(row + r) * columns + beside[:, c] % columns for r, c in corners]
    uv = [np.stack([beside[:, c] / columns, down[row + r]], 1) for r, c in corners]
    faces = np.stack(at, 1).reshape(-1, 3)
    return faces.astype(np.int32), np.stack(uv, 1).reshape(-1, 3, 2).astype(np.float32)


def _cloth(points: np.ndarray, faces: np.ndarray, rows: int, columns: int) -> Cloth:
    """Threads down and around, diagonals, and what keeps two neighbouring threads in line."""
    index = np.arange(rows * columns).reshape(rows, columns)
    around, over = np.roll(index, -1, axis=1), np.roll(index, -2, axis=1)
    kinds = [
        (index[:-1], index[1:], STRETCH),
        (index, around, STRETCH),
        (index[:-1], around[1:], SHEAR),
        (around[:-1], index[1:], SHEAR),
        (index[:-2], index[2:], BEND),
        (index, over, BEND),
    ]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b, _ in kinds])
    compliance = np.concatenate([np.full(a.size, value) for a, _, value in kinds])
    lengths = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    corners = points[faces]  # (F, 3, 3)
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    masses = np.zeros(len(points))
    np.add.at(masses, faces, DENSITY * area[:, None] / 3)
    return Cloth(points, masses, columns, pairs.astype(np.int32), lengths, compliance)
