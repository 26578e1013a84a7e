"""Weighted PCA, quantisation and distillation on arrays."""

import numpy as np
import pytest

from ico3d.avatar.baking.lowrank import factorise
from ico3d.avatar.baking.quantise import quantise
from ico3d.head.blending.distil import augmented, distil


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_samples_of_low_rank_come_back_exactly(rng):
    samples = rng.normal(size=(40, 3)) @ rng.normal(size=(3, 20_000)) + rng.normal(size=20_000)
    factors = factorise(samples.astype(np.float32), np.ones(20_000, np.float32), 8)
    assert not factors.basis[3:].any() and not factors.scores[:, 3:].any()
    np.testing.assert_allclose(factors.mean + factors.scores @ factors.basis, samples, atol=1e-3)


def test_more_components_than_samples_are_padded_with_zeros(rng):
    factors = factorise(rng.normal(size=(4, 30)).astype(np.float32), np.ones(30, np.float32), 8)
    assert factors.basis.shape == (8, 30) and factors.scores.shape == (4, 8)
    assert not factors.basis[3:].any()


def test_it_agrees_with_the_singular_value_decomposition(rng):
    samples = rng.normal(size=(30, 50)).astype(np.float32)
    weights = rng.uniform(0.5, 2, 50).astype(np.float32)
    factors = factorise(samples, weights, 5)
    u, s, vt = np.linalg.svd((samples - samples.mean(0)) * weights, full_matrices=False)
    best = (u[:, :5] * s[:5]) @ vt[:5]
    np.testing.assert_allclose(factors.scores @ factors.basis * weights, best, atol=1e-4)
    gram = (factors.basis * weights) @ (factors.basis * weights).T
    np.testing.assert_allclose(gram, np.eye(5), atol=1e-4)


def test_projection_of_the_samples_gives_their_scores(rng):
    samples = rng.normal(size=(30, 9_000)).astype(np.float16)
    factors = factorise(samples, rng.uniform(0.5, 2, 9_000).astype(np.float32), 6)
    np.testing.assert_allclose(factors.project(samples), factors.scores, rtol=1e-3, atol=2e-2)


def test_what_matters_more_is_kept_better(rng):
    samples = rng.normal(size=(60, 40)).astype(np.float32)
    weights = np.ones(40, np.float32)
    weights[:5] = 100
    factors = factorise(samples, weights, 5)
    error = factors.mean + factors.scores @ factors.basis - samples
    assert np.abs(error[:, :5]).max() < 0.02 < np.abs(error[:, 5:]).max()


def test_rounding_errs_by_at_most_half_a_step(rng):
    basis = rng.normal(size=(6, 100, 4)).astype(np.float32) * rng.lognormal(size=(1, 100, 1))
    sizes = 2.0 ** -np.arange(6)
    rounded = quantise(basis.astype(np.float32), sizes, np.ones((100, 4), np.float32))
    assert rounded.values.dtype == np.int8 and np.abs(rounded.values).max() == 127
    step = rounded.gains[:, None, None] * rounded.scale[None, :, None]
    assert (np.abs(rounded.restored() - basis) <= 0.5001 * step).all()


def test_lengthening_beats_plain_rounding_where_small_vectors_peak(rng):
    """A small component that peaks at each Gaussian must not take precision from the large one."""
    basis = np.concatenate([np.full((1, 50, 4), 0.1), np.full((1, 50, 4), 10.0)]).astype(np.float32)
    basis[0] *= rng.uniform(0.5, 1, (50, 4))
    sizes, ones = np.array([100.0, 1e-3]), np.ones((50, 4), np.float32)
    rounded = quantise(basis, sizes, ones)
    assert np.abs(rounded.restored()[0] / basis[0] - 1).max() < 0.02


def test_zero_vectors_round_to_zero():
    rounded = quantise(np.zeros((3, 5, 4), np.float32), np.zeros(3), np.ones((5, 4), np.float32))
    assert not rounded.restored().any() and np.isfinite(rounded.gains).all()


def test_the_network_learns_a_smooth_function(rng):
    expressions = rng.uniform(0, 1, (600, 12)).astype(np.float32)
    mixing = rng.normal(size=(12, 5)).astype(np.float32)

    def truth(e):
        return np.tanh(e @ mixing) * (100, 30, 10, 3, 1)

    network = distil(expressions, truth(expressions).astype(np.float32), 64, 600, seed=0)
    fresh = rng.uniform(0.1, 0.9, (200, 12)).astype(np.float32)
    hidden = fresh @ network.w1 + network.b1
    answer = np.where(hidden > 0, hidden, 0.02 * hidden) @ network.w2 + network.b2
    error = (
        np.square(answer - truth(fresh)).sum()
        / np.square(truth(fresh) - truth(fresh).mean(0)).sum()
    )
    assert error < 0.02


def test_one_seed_gives_one_network(rng):
    expressions, scores = rng.normal(size=(50, 8)), rng.normal(size=(50, 3))
    first, second = (distil(expressions, scores, 16, 20, seed=4) for _ in "ab")
    for name in vars(first):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_constant_inputs_do_no_harm(rng):
    expressions = rng.normal(size=(50, 8))
    expressions[:, 3] = 0.25
    network = distil(expressions, rng.normal(size=(50, 3)), 16, 20, seed=4)
    assert all(np.isfinite(getattr(network, name)).all() for name in vars(network))


def test_augmented_expressions_stay_near_the_recorded_ones(rng):
    recorded = rng.uniform(0, 1, (100, 39))
    made = augmented(recorded, 500, rng)
    assert made.shape == (500, 39) and made.dtype == np.float32
    assert made.min() > -0.25 and made.max() < 1.25
