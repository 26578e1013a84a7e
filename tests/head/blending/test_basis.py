"""Blending and learning the latent basis: kernels against plain torch in float64."""

import pytest
import torch

from ico3d.head.blending.basis import blend, blend_of, update_basis
from ico3d.training.optimiser import Optimiser

ROWS, COUNT, WIDTH = 5, 700, 32  # more than one kernel block


def _case(dtype: torch.dtype) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    basis = torch.randn(ROWS, COUNT, WIDTH, generator=generator, dtype=torch.float64)
    weights = torch.tensor([0.5, 0.0, -1.0, 0.25, 1.0], dtype=torch.float64)
    gradient = torch.randn(COUNT, WIDTH, generator=generator, dtype=torch.float64)
    return basis.to(dtype), weights.to(dtype), gradient.to(dtype)


def test_blend_is_the_weighted_sum():
    basis, weights, _ = _case(torch.float32)
    expected = (weights[:, None, None].double() * basis.double()).sum(0)
    torch.testing.assert_close(blend(basis, weights).double(), expected, rtol=1e-5, atol=1e-5)


def test_gradients_by_finite_differences():
    generator = torch.Generator().manual_seed(2)
    basis = torch.randn(4, 3, 2, generator=generator, dtype=torch.float64, requires_grad=True)
    weights = torch.randn(4, generator=generator, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(blend, (basis, weights))


def test_kernel_gradients_equal_the_reference():
    found = []
    for dtype in (torch.float32, torch.float64):
        basis, weights, gradient = _case(dtype)
        basis.requires_grad_()
        weights.requires_grad_()
        blend(basis, weights).backward(gradient)
        found.append((basis.grad.double(), weights.grad.double()))
    for kernel, reference in zip(*found, strict=True):
        torch.testing.assert_close(kernel, reference, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(
    ("kind", "rmsprop"), [("adam", False), ("adam", True), ("sgd", False)], ids=str
)
def test_rank_one_update_equals_the_reference(kind, rmsprop):
    found = []
    for dtype in (torch.float32, torch.float64):
        basis, weights, gradient = _case(dtype)
        optimiser = Optimiser(kind)
        for step in range(4):
            active = weights * (torch.arange(ROWS) != step)
            pulled = gradient * (1 + step)
            update_basis(optimiser, basis, active, pulled, 0.01, 0.3, rmsprop=rmsprop)
        found.append(basis.double())
    torch.testing.assert_close(found[0], found[1], rtol=1e-5, atol=1e-5)


def test_weight_decay_pulls_every_row_but_the_bias():
    basis, weights, gradient = _case(torch.float64)
    before = basis.clone()
    update_basis(Optimiser("sgd"), basis, weights, 0 * gradient, 0.1, weight_decay=0.5)
    torch.testing.assert_close(basis[[0, 2, 3]], 0.95 * before[[0, 2, 3]])
    assert torch.equal(basis[[1, 4]], before[[1, 4]])  # unused, and the bias


def test_rank_one_update_equals_a_dense_one_and_leaves_unused_rows_alone():
    basis, weights, gradient = _case(torch.float64)
    dense, before = basis.clone(), basis.clone()
    update_basis(Optimiser(), basis, weights, gradient, 0.01)
    Optimiser().update("x", dense, weights[:, None, None] * gradient, 0.01)
    torch.testing.assert_close(basis, dense)
    assert torch.equal(basis[1], before[1])


def test_the_first_step_of_rmsprop_is_the_rate_times_the_gradient_of_unit_mean_square():
    basis, weights, gradient = _case(torch.float64)
    gradient[3] = 0  # a Gaussian that the picture does not show
    before, optimiser = basis.clone(), Optimiser()
    update_basis(optimiser, basis, weights, gradient, 0.01, rmsprop=True)
    unit = gradient / gradient.square().mean(1, keepdim=True).sqrt().clamp_min(1e-9)
    expected = -0.01 * weights.sign()[:, None, None] * unit
    torch.testing.assert_close(basis - before, expected, rtol=1e-5, atol=1e-7)
    assert optimiser.moments["basis.second"].shape == (ROWS, COUNT)
    assert "basis.first" not in optimiser.moments


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_blending_some_gaussians_gives_their_part_of_the_whole(dtype):
    basis, weights, _ = _case(dtype)
    chosen = torch.tensor([0, 3, 64, 65, 699])
    torch.testing.assert_close(blend_of(basis, weights, chosen), blend(basis, weights)[chosen])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize(
    ("kind", "rmsprop"), [("adam", False), ("adam", True), ("sgd", False)], ids=str
)
def test_updating_some_gaussians_is_updating_a_basis_of_those_alone(kind, rmsprop, dtype):
    basis, weights, gradient = _case(dtype)
    chosen = torch.arange(0, COUNT, 3)
    alone, before = basis[:, chosen].clone(), basis.clone()
    whole, part = Optimiser(kind), Optimiser(kind)
    for size in (1.0, -3.0):
        pulled = size * gradient[chosen]
        update_basis(whole, basis, weights, pulled, 0.01, 0.3, rmsprop, chosen)
        update_basis(part, alone, weights, pulled, 0.01, 0.3, rmsprop)
    torch.testing.assert_close(basis[:, chosen], alone, rtol=1e-5, atol=1e-6)
    others = torch.ones(COUNT, dtype=torch.bool)
    others[chosen] = False
    assert torch.equal(basis[:, others], before[:, others])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize(
    ("kind", "rmsprop"), [("adam", False), ("adam", True), ("sgd", False)], ids=str
)
def test_a_rate_for_each_row_scales_its_step(kind, rmsprop, dtype):
    steps = []
    for rate in (0.01, 0.01 * torch.tensor([1.0, 1.0, 4.0, 0.5, 1.0], dtype=dtype)):
        basis, weights, gradient = _case(dtype)
        before = basis.clone()
        update_basis(Optimiser(kind), basis, weights, gradient, rate, rmsprop=rmsprop)
        steps.append(basis - before)
    factors = torch.tensor([1.0, 1.0, 4.0, 0.5, 1.0], dtype=dtype)[:, None, None]
    torch.testing.assert_close(steps[1], factors * steps[0], rtol=1e-4, atol=1e-5)
