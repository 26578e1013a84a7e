"""The optimiser against torch's own, and its kernel against its reference."""

import torch

from ico3d.training.optimiser import EPSILON, Optimiser
from ico3d.training.rate import Rate


def _gradients(count: int, shape: tuple[int, ...], dtype: torch.dtype) -> list[torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    return [torch.randn(shape, generator=generator, dtype=dtype) for _ in range(count)]


def _adam_of_torch(gradients, rate, weight_decay):
    value = torch.nn.Parameter(torch.ones_like(gradients[0]))
    adam = torch.optim.Adam([value], lr=rate, eps=EPSILON, weight_decay=weight_decay)
    for gradient in gradients:
        value.grad = gradient.clone()
        adam.step()
    return value.detach()


def _ours(gradients, rate, weight_decay):
    optimiser, value = Optimiser(), torch.ones_like(gradients[0])
    for gradient in gradients:
        optimiser.update("x", value, gradient, rate, weight_decay)
    return value


def test_reference_equals_torch_adam_in_float64():
    gradients = _gradients(7, (5, 3), torch.float64)
    expected = _adam_of_torch(gradients, 0.1, 0.01)
    torch.testing.assert_close(_ours(gradients, 0.1, 0.01), expected, rtol=1e-6, atol=1e-9)


def test_kernel_equals_torch_adam():
    gradients = _gradients(7, (1000, 3), torch.float32)
    torch.testing.assert_close(_ours(gradients, 0.1, 0.0), _adam_of_torch(gradients, 0.1, 0.0))


def test_sgd_subtracts_the_scaled_gradient():
    value = torch.tensor([1.0, 2.0])
    Optimiser("sgd").update("x", value, torch.tensor([10.0, -10.0]), 0.01)
    torch.testing.assert_close(value, torch.tensor([0.9, 2.1]))


def test_rate_decays_exponentially():
    rate = Rate(1.0, 0.01)
    assert [rate.at(p) for p in (0.0, 1.0)] == [1.0, 0.01]
    assert abs(rate.at(0.5) - 0.1) < 1e-12
