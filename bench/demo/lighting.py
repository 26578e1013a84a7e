"""A window's light on the packaged avatar: from her right, so that her face has a side of shade.

Her studio lights her evenly, since what is in shade while it is recorded is learnt badly. A room
with a window does not. So light is added to what was learnt, by the direction that each surface
faces, as the room that the page shows behind her has it (viewer/src/stage/window-light.ts).
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ico3d.avatar.joining.normals import surface_normals
from ico3d.bundle.head import BakedHead
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.posing import harmonics
from ico3d.common.spread import directions

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
DEEP = 0.05
"""Metres from the median of a head's Gaussians, which are mostly in the face, to its inside."""
REDDEST = 1.25
"""By how much the logit of red exceeds that of green in the head at most, as in 19 of 20 Gaussians:
at temples under hair, light that went through skin glowed in the new shade."""


def lit_body(body: BakedSkinned) -> BakedSkinned:
    """The body in the window's light, in every pose."""
    constant, rest = _light()
    normals = body.normals / np.linalg.norm(body.normals.astype(np.float64), axis=1, keepdims=True)
    even = _evened(body.means.astype(np.float64), body.opacities / 255, normals)
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
    opacities = 1 / (1 + np.exp(-logits[:, 3]))  # (N,)
    means = head.means.astype(np.float64)
    middle = np.median(means, axis=0) - (0, 0, DEEP)
    facing = _evened(means, opacities, surface_normals(means, opacities, middle))
    logits[:, :3] += constant + harmonics(facing) @ rest
    return replace(head, mean_logits=logits.astype(np.float16))


def _light() -> tuple[np.ndarray, np.ndarray]:
    """What the light adds to logits: a constant (3,), and (8, 3) for `harmonics` of normals."""
    window = np.array(WINDOW) / np.linalg.norm(WINDOW)
    normals = directions(2000)
    falling = np.maximum((normals @ window + AROUND) / (1 + AROUND), 0)  # (N,)
    added = np.log1p(STRENGTH * falling)[:, None] * TINT  # (N, 3)
    smooth = np.column_stack([np.ones(len(normals)), harmonics(normals)])  # (N, 9)
    rest = np.linalg.lstsq(smooth, added, rcond=None)[0][1:]  # (8, 3)
    return np.array(LIT) - (harmonics(window[None]) @ rest)[0], rest


def _evened(points: np.ndarray, opacities: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) unit normals like those of their neighbours on the same side of a surface.

    Args:
        points: (N, 3) metres.
        opacities: (N,).
        normals: (N, 3) unit vectors.
    """
    apart, near = KDTree(points).query(points, NEIGHBOURS)  # (N, K), (N, K)
    weights = (opacities[near] + 1e-6) * np.exp(-2 * (apart / REACH) ** 2) * (apart < REACH)
    for _ in range(ROUNDS):
        same = np.maximum((normals[near] * normals[:, None]).sum(-1), 0)  # (N, K)
        mean = np.einsum("nk,nkd->nd", weights * same, normals[near])
        normals = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    return normals
