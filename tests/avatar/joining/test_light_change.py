"""A change of light is found from pixels."""

import numpy as np
import pytest
import torch

from ico3d.avatar.joining import light_change
from ico3d.avatar.joining.light_change import bounds, improved, no_change
from ico3d.splat import harmonics

LAMP = np.zeros((9, 3))
LAMP[:4] = [[1.2, -0.4, -1.6], [0.2, 0.1, -0.1], [-0.3, 0.2, 0.1], [0.8, 0.5, 0.3]]
LAMP[6] = -0.2, 0.1, 0.15


@pytest.fixture
def ball():
    """Harmonics (P, 9) and own colours (P, 3) of places all over a ball."""
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(600, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return harmonics.basis(torch.from_numpy(ways), 2).numpy(), rng.uniform(0.2, 0.8, (600, 3))


def _under(change, basis, own):
    """(P, 3) colours in changed light."""
    return 1 / (1 + np.exp(-np.log(own / (1 - own)) - basis @ change))


def _found(basis, own, seen, weight, rounds=12):
    change = no_change()
    for _ in range(rounds):
        change = improved(change, _under(change, basis, own), seen, basis, weight)
    return change


def test_a_gain_and_a_lamp_are_found(ball, monkeypatch):
    """To the last digit where nothing is held against them, and nearly so with the prior."""
    basis, own = ball
    seen, everywhere = _under(LAMP, basis, own), np.ones(len(own))
    near = _found(basis, own, seen, everywhere)
    assert np.abs(basis @ (near - LAMP)).max() < 0.06
    monkeypatch.setattr(light_change, "PRIOR", 0.0)
    exact = _found(basis, own, seen, everywhere)
    np.testing.assert_allclose(exact, LAMP, atol=1e-9)


def test_an_outlier_does_not_matter(ball):
    """A hand or a highlight: white in one pixel of a hundred changes logits by a hundredth."""
    basis, own = ball
    seen, everywhere = _under(LAMP, basis, own), np.ones(len(own))
    clean = _found(basis, own, seen, everywhere)
    seen[::100] = 1.0
    assert np.abs(basis @ (_found(basis, own, seen, everywhere) - clean)).max() < 0.03


def test_a_side_that_is_not_seen_has_the_gain_alone(ball, monkeypatch):
    """Noise in pixels from in front hardly becomes a lamp behind, as it would without the prior."""
    basis, own = ball
    gain = np.zeros((9, 3))
    gain[0] = LAMP[0]
    rng = np.random.default_rng(1)
    seen = _under(gain, basis, own) + rng.normal(0, 0.02, own.shape)
    front = basis[:, 2] > 0.2  # z of the normal times .49
    behind = []
    for prior in (light_change.PRIOR, 0.0):
        monkeypatch.setattr(light_change, "PRIOR", prior)
        change = _found(basis, own, seen, front.astype(float))
        behind.append(np.abs((basis @ (change - gain))[basis[:, 2] < -0.2]).max())
    assert behind[0] < 0.15 and behind[0] < 0.7 * behind[1], behind


def test_without_pixels_the_light_stays(ball):
    basis, own = ball
    nowhere = np.zeros(len(own))
    change = improved(no_change(), own, 0 * own, basis, nowhere)
    np.testing.assert_array_equal(change, 0)
    np.testing.assert_array_equal(bounds(LAMP, basis, nowhere), 0)


def test_bounds_are_what_was_seen(ball):
    """All but the outermost hundredths."""
    basis, _ = ball
    weight = (basis[:, 2] > 0).astype(float)
    shown = np.sort(basis[weight > 0] @ LAMP, axis=0)
    least, most = bounds(LAMP, basis, weight)
    assert (shown[0] <= least).all() and (least <= shown[9]).all()
    assert (shown[-9] <= most).all() and (most <= shown[-1]).all()
