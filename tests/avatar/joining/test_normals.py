"""Normals of a head's surface."""

import numpy as np
import pytest

from ico3d.avatar.joining.normals import surface_normals

AXES = np.array([0.075, 0.11, 0.09])


@pytest.fixture
def egg():
    """Places (N, 3) on an ellipsoid, 1 mm off it at random, and their true normals (N, 3)."""
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(3000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    normals = ways / AXES
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return AXES * ways + rng.normal(0, 0.001, (3000, 1)) * normals, normals


def _degrees(found, truth):
    return np.degrees(np.arccos((found * truth).sum(1).clip(-1, 1)))


def test_normals_of_an_egg(egg):
    """Within a few degrees, whatever is faint beside and within it."""
    places, normals = egg
    rng = np.random.default_rng(1)
    faint = 0.08 * rng.normal(size=(1500, 3))
    opacities = np.r_[np.full(3000, 0.8), np.full(1500, 0.1)]
    middle = np.array([0.01, -0.02, 0.0])
    found = surface_normals(np.concatenate([places, faint]), opacities, middle)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    away = _degrees(found[:3000], normals)
    assert np.median(away) < 3 and away.max() < 12


def test_few_gaussians(egg):
    """Fewer than neighbours are asked for: still out of the head."""
    places = egg[0][:20]
    found = surface_normals(places, np.zeros(20), np.zeros(3))
    assert np.isfinite(found).all() and len(found) == 20
