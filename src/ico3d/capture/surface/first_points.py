"""Initial surface points of a person in a portrait."""

import numpy as np

from ico3d.common.camera import Camera

PER_TRIANGLE = 6
"""Number of points drawn in each triangle of the face."""
THICKNESS = 0.008
"""Standard deviation in metres of the depth of guessed points."""


def face_points(face: np.ndarray, triangles: np.ndarray, seed: int = 0) -> np.ndarray:
    """Random points on the tracked face.

    Args:
        face: (468, 3) landmarks in canonical head space, metres.
        triangles: (T, 3) indices of landmarks.
        seed: Seed of the positions within the triangles.

    Returns:
        (P, 3) float32 metres.
    """
    random = np.random.default_rng(seed)
    shares = random.dirichlet(np.ones(3), (len(triangles), PER_TRIANGLE))  # (T, n, 3)
    drawn = np.einsum("tnk,tkd->tnd", shares, face[triangles])  # (T, n, 3)
    return drawn.reshape(-1, 3).astype(np.float32)


def silhouette_points(
    mask: np.ndarray, camera: Camera, head: np.ndarray, depths: tuple[float, float], count: int
) -> np.ndarray:
    """Points on a bulging sheet that fills a part of a picture.

    Args:
        mask: (H, W) bool, the part of the picture.
        camera: The camera that took the picture.
        head: (4, 4) head pose in that picture, head to world.
        depths: Metres by which the sheet's outline and middle lie nearer than the head's origin.
        count: Number of points.

    Returns:
        (count, 3) float32 in canonical head space, metres; empty if the mask is.
    """
    from scipy.ndimage import distance_transform_edt

    rows, columns = np.nonzero(mask)
    if not len(rows):
        return np.empty((0, 3), np.float32)
    random = np.random.default_rng(count)
    drawn = random.integers(0, len(rows), count)
    inside = np.asarray(distance_transform_edt(mask))[rows[drawn], columns[drawn]]
    bulge = depths[0] + (depths[1] - depths[0]) * np.sqrt(inside / inside.max())
    moved = camera.moved(head)
    depth = moved.world_to_camera[2, 3] - bulge + random.normal(0, THICKNESS, count)
    pixels = np.stack([columns[drawn], rows[drawn]], 1) + random.random((count, 2))
    rays = np.concatenate([pixels, np.ones((count, 1))], 1) @ np.linalg.inv(moved.intrinsics).T
    local = np.concatenate([rays * depth[:, None], np.ones((count, 1))], 1)  # (count, 4)
    return (local @ moved.camera_to_world.T)[:, :3].astype(np.float32)


def body_guess(face: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(P, 3) points of a guessed body: ellipsoid for skull and hair, cylinder neck, chest sheet."""
    half = np.ptp(face[:, 0]) / 2
    top, chin = face[:, 1].max(), face[:, 1].min()
    depth = face[:, 2].min()
    center = np.array([0.0, (top + 0.15 * chin) / 2 + 0.015, depth])
    skull = _sphere(random, 4000) * [1.25 * half, 0.62 * (top - chin), 1.3 * half] + center
    skull = skull[skull[:, 2] < depth + 0.6 * half]
    return np.concatenate(
        [skull, _neck(random, half, chin, depth), _chest(random, half, chin, depth)]
    )


def _sphere(random: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3) points on the unit sphere."""
    points = random.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _neck(random: np.random.Generator, half: float, chin: float, depth: float) -> np.ndarray:
    """(800, 3) points around the neck."""
    turn = random.uniform(0, 2 * np.pi, 800)
    height = random.uniform(chin - 0.09, chin + 0.05, 800)
    radius = 0.75 * half
    return np.stack([radius * np.sin(turn), height, depth + radius * np.cos(turn)], 1)


def _chest(random: np.random.Generator, half: float, chin: float, depth: float) -> np.ndarray:
    """(3000, 3) points on shoulders and chest, sloping away from the neck."""
    aside = random.uniform(-3.2, 3.2, 3000) * half
    slope = chin - 0.05 - 0.25 * np.abs(aside)
    height = slope - random.uniform(0, 0.22, 3000)
    front = depth + 0.9 * half - 0.18 * np.abs(aside) + 0.3 * (slope - height)
    return np.stack([aside, height, front], 1)


def unknown_person(seed: int = 0) -> np.ndarray:
    """(P, 3) float32 points of a head of usual size, for captures without a tracked face."""
    random = np.random.default_rng(seed)
    half, top, chin, front = 0.075, 0.083, -0.094, 0.06
    face = _sphere(random, 5000) * [half, (top - chin) / 2, front] + [0, (top + chin) / 2, 0]
    outline = np.array([[-half, chin, 0.0], [half, top, 0.0]])
    front_face = face[face[:, 2] > 0]
    return np.concatenate([front_face, body_guess(outline, random)]).astype(np.float32)
