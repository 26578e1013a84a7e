"""Somebody who wears nothing but an open sleeve, from the left shoulder to the wrist."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.studio.choice import load_subject
from ico3d.studio.person.subject import Material, Subject
from support.recordings import synthetic_bodies


def sleeved(folder: Path, rings: int, sides: int, radius: float) -> Subject:
    """The person, whose sleeve of `rings` rings of `sides` vertices bends at the elbow.

    Args:
        folder: Where the person's file is written.
        rings: Rings of vertices along the arm.
        sides: Vertices of a ring.
        radius: Radius of the sleeve, metres.
    """
    path = synthetic_bodies.write_body(folder / "tubes.npz")
    person = load_subject(str(path), whole=True)
    bones = person.skeleton
    assert bones is not None
    start, elbow, end = (
        bones.at[bones.index(f"{n}.L")] for n in ("upperarm01", "lowerarm01", "wrist")
    )
    along = np.linspace(0, 1, rings)[:, None]
    middle = np.where(along < 0.5, start + 2 * along * (elbow - start), 0)
    middle += np.where(along >= 0.5, elbow + (2 * along - 1) * (end - elbow), 0)
    turn = 2 * np.pi * np.arange(sides) / sides
    first, second = np.linalg.svd((end - start)[None])[2][1:]  # (3,) each, across the arm
    if np.cross(first, second) @ (end - start) < 0:
        second = -second  # triangles are counter-clockwise from outside
    ring = radius * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)
    points = (middle[:, None] + ring).reshape(-1, 3)
    row, column = (i.ravel() for i in np.mgrid[: rings - 1, :sides])
    a, b = row * sides + column, row * sides + (column + 1) % sides
    faces = np.concatenate([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])
    weights = np.zeros((len(points), len(bones.names)), np.float32)
    lower = np.repeat(np.clip((along[:, 0] - 0.5) * 8 + 0.5, 0, 1), sides)
    weights[:, bones.index("upperarm01.L")] = 1 - lower
    weights[:, bones.index("lowerarm01.L")] = lower
    return replace(
        person,
        vertices=points.astype(np.float32),
        faces=faces.astype(np.int32),
        materials=np.full(len(faces), Material.CLOTH, np.uint8),
        corner_uv=np.zeros((len(faces), 3, 2), np.float32),
        skeleton=replace(bones, weights=weights),
    )
