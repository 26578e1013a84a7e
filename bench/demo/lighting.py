"""A window's light on the packaged avatar: from her right, so that her face has a side of shade.

Her studio lights her evenly, since what is in shade while it is recorded is learnt badly. A room
with a window does not. So light is added to what was learnt, by the direction that each surface
faces, as the room that the page shows behind her has it (viewer/src/stage/window-light.ts).
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ico3d.bundle.head import BakedHead
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.posing import harmonics

WINDOW = (-0.75, 0.45, 0.60)
"""Direction of the middle of the window from her: her right, up, and the front; of any length."""
STRENGTH = 3.0
"""Its light where it falls straight on, in units of the light from all around."""
AROUND = 0.2
"""Cosine by which a wide window also lights what faces away from its middle."""
TINT = (1.0, 0.97, 0.92)
"""Share of that light which is there of r, g and b: the sun is warm, the sky in the shade blue."""
LIT = (0.50, 0.46, 0.38)
"""What is added to the logits of r, g and b where the light falls straight on. Elsewhere they
lose: brighter skin would have no room left for its colour."""
REACH, NEIGHBOURS, ROUNDS = 0.02, 64, 2
"""Metres and number of Gaussians within which a surface is taken for even, and how often directions
are evened over them: hair would have one of its own on each strand, and wool showed stains."""
REDDEST = 1.25
"""By how much the logit of red exceeds that of green in the head at most, as in 19 of 20 Gaussians:
at temples under hair, light that went through skin glowed in the new shade."""


def lit_body(body: BakedSkinned) -> BakedSkinned:
    """The body in the window's light, in every pose."""
    constant, rest = _light()
    normals = body.normals / np.linalg.norm(body.normals.astype(np.float64), axis=1, keepdims=True)
    near, weights = _neighbours(body.means.astype(np.float64), body.opacities / 255)
    even = normals
    for _ in range(ROUNDS):
        same = np.maximum((even[near] * even[:, None]).sum(-1), 0)  # (N, K), not the other side
        even = _mean(even[near], weights * same)
    was = (harmonics(normals) - harmonics(even)) @ body.light  # (N, 3), lost with the old normals
    return replace(
        body,
        color_logits=(body.color_logits + was + constant).astype(np.float16),
        light=(body.light + rest).astype(np.float32),
        normals=np.round(even * 127).astype(np.int8),
    )


def lit_head(head: BakedHead) -> BakedHead:
    """The head in the window's light, which turns with it."""
    constant, rest = _light()
    logits = head.mean_logits.astype(np.float64)
    excess = np.maximum(logits[:, 0] - logits[:, 1] - REDDEST, 0)[:, None]  # (N, 1)
    logits[:, :3] += excess * (-0.3, 0.7, 0.5)
    logits[:, :3] += constant + harmonics(_facing(head)) @ rest
    return replace(head, mean_logits=logits.astype(np.float16))


def _light() -> tuple[np.ndarray, np.ndarray]:
    """What the light adds to logits: a constant (3,), and (8, 3) for `harmonics` of normals."""
    window = np.array(WINDOW) / np.linalg.norm(WINDOW)
    normals = _sphere(2000)
    falling = np.maximum((normals @ window + AROUND) / (1 + AROUND), 0)  # (N,)
    added = np.log1p(STRENGTH * falling)[:, None] * TINT  # (N, 3)
    smooth = np.column_stack([np.ones(len(normals)), harmonics(normals)])  # (N, 9)
    rest = np.linalg.lstsq(smooth, added, rcond=None)[0][1:]  # (8, 3)
    return np.array(LIT) - (harmonics(window[None]) @ rest)[0], rest


def _sphere(count: int) -> np.ndarray:
    """(N, 3) unit vectors, spread evenly along a spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count  # (N,)
    turn = np.pi * (1 + 5**0.5) * np.arange(count)  # (N,)
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(turn), height, across * np.sin(turn)], 1)


def _facing(head: BakedHead) -> np.ndarray:
    """(N, 3) unit vectors in which a head's surface faces at each Gaussian."""
    points = head.means.astype(np.float64)
    opacities = 1 / (1 + np.exp(-head.mean_logits[:, 3].astype(np.float64)))  # (N,)
    near, weights = _neighbours(points, opacities)
    offsets = points[near] - points[:, None]  # (N, K, 3)
    middle = np.einsum("nk,nkd->nd", weights, offsets) / weights.sum(1, keepdims=True)
    offsets = (offsets - middle[:, None]) * np.sqrt(weights)[..., None]
    spread = np.einsum("nki,nkj->nij", offsets, offsets)  # (N, 3, 3)
    normals = np.linalg.eigh(spread)[1][..., 0]  # (N, 3), along which the surface is thinnest
    outwards = points - _axis(points)
    normals *= np.where((normals * outwards).sum(1) < 0, -1.0, 1.0)[:, None]
    for _ in range(ROUNDS):
        normals = _mean(normals[near], weights)
    return normals


def _neighbours(points: np.ndarray, opacities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices (N, K) of the Gaussians about each, itself included, and weights (N, K).

    Args:
        points: (N, 3) metres.
        opacities: (N,).
    """
    apart, near = KDTree(points).query(points, NEIGHBOURS)  # (N, K), (N, K)
    falling = np.exp(-2 * (apart / REACH) ** 2) * (apart < REACH)  # (N, K)
    return near, (opacities[near] + 1e-6) * falling


def _mean(vectors: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(N, 3) unit vectors along the means of (N, K, 3), weighted by (N, K)."""
    mean = np.einsum("nk,nkd->nd", weights, vectors)
    return mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)


def _axis(points: np.ndarray) -> np.ndarray:
    """(N, 3) the nearest points on a line upwards through the middle of a head of points (N, 3)."""
    low, high = np.quantile(points[:, 1], (0.2, 0.8))
    middle = np.median(points, axis=0) - (0, 0, 0.02)  # most Gaussians are in the face
    height = np.clip(points[:, 1], low, high)
    return np.stack([np.zeros_like(height), height, np.full_like(height, middle[2])], 1)
