"""The reference evaluator against closed forms."""

import numpy as np

from ico3d.bundle.evaluate import attributes, centres, coefficients, logits, steps
from support.bundles.random_bundle import random_head


def test_zero_coefficients_give_the_mean_look():
    head = random_head(20)
    silent = type(head)(**{**vars(head), "w2": head.w2 * 0})
    rgb, opacity = attributes(silent, np.ones(39))
    expected = 1 / (1 + np.exp(-head.mean_logits.astype(np.float32)))
    np.testing.assert_allclose(rgb, expected[:, :3], rtol=1e-6)
    np.testing.assert_allclose(opacity, expected[:, 3], rtol=1e-6)


def test_it_is_the_documented_formula():
    """Written out with loops in float64."""
    head, e = random_head(5, rank=3, hidden=4), np.linspace(-1, 1, 39)
    hidden = [sum(e[b] * head.w1[b, h] for b in range(39)) + head.b1[h] for h in range(4)]
    hidden = [x if x > 0 else 0.02 * x for x in hidden]
    c = [sum(hidden[h] * head.w2[h, k] for h in range(4)) + head.b2[k] for k in range(3)]
    np.testing.assert_allclose(coefficients(head, e), c, rtol=1e-5)
    for n in range(5):
        for j in range(4):
            blend = sum(c[k] * int(head.basis[k, n, j]) for k in range(3))
            expected = float(head.mean_logits[n, j]) + float(head.basis_scale[n]) * blend
            np.testing.assert_allclose(logits(head, e)[n, j], expected, rtol=1e-5, atol=1e-5)


def test_centres_are_the_documented_formula():
    head, e = random_head(5), np.linspace(-1, 1, 39)
    w1, b1 = head.displacement_w1.astype(np.float64), head.displacement_b1
    hidden = [sum(e[b] * w1[b, g] for b in range(39)) + b1[g] for g in range(64)]
    hidden = [x if x > 0 else 0.02 * x for x in hidden]
    w2, b2 = head.displacement_w2.astype(np.float64), head.displacement_b2
    metres = [sum(hidden[g] * w2[g, m] for g in range(64)) + b2[m] for m in range(2)]
    np.testing.assert_allclose(steps(head, e), metres, rtol=1e-4)
    moved = centres(head, e)
    assert np.abs(moved - head.means).max() > 1e-3
    for n in range(5):
        for axis in range(3):
            by = sum(metres[m] * int(head.displacement_basis[m, n, axis]) for m in range(2))
            np.testing.assert_allclose(moved[n, axis], head.means[n, axis] + by, atol=1e-6)


def test_the_last_two_displacements_turn_the_eyes():
    head, e = random_head(5), np.linspace(-1, 1, 39)
    moved = centres(head, e, (0.1, -0.05)).astype(np.float64)
    metres = 1.25e-4 * np.array([0.1, -0.05])  # instead of what the network says
    by = np.einsum("m,mnk->nk", metres, head.displacement_basis.astype(np.float64))
    np.testing.assert_allclose(moved, head.means + by, atol=1e-7)


def test_tracks_are_evaluated_row_by_row():
    head, track = random_head(20), np.random.default_rng(0).normal(size=(6, 39))
    rows = np.stack([coefficients(head, row) for row in track])
    np.testing.assert_allclose(coefficients(head, track), rows, rtol=1e-5, atol=1e-6)


def test_large_logits_saturate_without_warnings():
    head = random_head(20)
    extreme = type(head)(**{**vars(head), "basis_scale": np.full(20, 1e4, np.float32)})
    with np.errstate(all="raise", under="ignore"):
        rgb, opacity = attributes(extreme, np.full(39, 10.0))
    assert np.isfinite(rgb).all() and ((opacity >= 0) & (opacity <= 1)).all()
