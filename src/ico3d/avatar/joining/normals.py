"""Normals of the surface that a head's Gaussians make up.

A Gaussian's own axes are no normals: many are nearly round, others lie across the surface to paint
an edge, and where they overlap nothing in the pictures decides how they are turned. The places of
many Gaussians together tell the surface, as smoothly as light of low order asks for.
"""

import numpy as np
from scipy.spatial import KDTree

NEIGHBOURS = 24
"""Number of Gaussians from which a normal is told."""
SOLID = 0.3
"""Opacity above which a Gaussian belongs to the surface."""


def surface_normals(means: np.ndarray, opacities: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Unit normals that point out of a head.

    A normal is the direction in which neighbours spread least, mixed with the direction away from
    the head's middle the more, the less flat the neighbours lie, and averaged over neighbours.

    Args:
        means: (N, 3) places of the Gaussians.
        opacities: (N,) their opacities; the faint have the normals of the solid about them.
        middle: (3,) a point deep inside the head.

    Returns:
        (N, 3) float64.
    """
    solid = opacities > SOLID
    solid = solid if solid.sum() > NEIGHBOURS else np.ones(len(means), bool)
    places = means[solid].astype(np.float64)  # (S, 3)
    tree = KDTree(places)
    own = _told_by(tree, places, middle)  # (S, 3)
    _, nearest = tree.query(means, k=min(NEIGHBOURS, len(places)))  # (N, K)
    return _unit(own[nearest].mean(1))


def _told_by(tree: KDTree, places: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """(S, 3) unit normals at places (S, 3), each of its own neighbours."""
    _, nearest = tree.query(places, k=min(NEIGHBOURS, len(places)))  # (S, K)
    around = places[nearest]  # (S, K, 3)
    around = around - around.mean(1, keepdims=True)
    spread, axes = np.linalg.eigh(around.mT @ around)  # (S, 3), (S, 3, 3)
    away = _unit(places - middle)  # (S, 3)
    thin = axes[:, :, 0]  # (S, 3)
    thin = thin * np.where((thin * away).sum(1) < 0, -1.0, 1.0)[:, None]
    flat = 1 - spread[:, :1] / np.maximum(spread[:, 1:2], 1e-30)  # (S, 1)
    return _unit(flat * thin + (1 - flat) * away)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
