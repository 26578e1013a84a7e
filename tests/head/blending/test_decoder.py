"""The head's MLP on the CPU: kernels against plain torch in float64."""

import pytest
import torch

from ico3d.head.blending.decoder import decode
from ico3d.head.model import HeadModel
from support.heads.shapes import head_shape

COUNT = 700  # more than one part of a kernel's work
NAMES = ("trunk.weight", "trunk.bias", "color_branch.weight", "opacity_branch.bias")


def _model(sh_degree: int) -> HeadModel:
    shape = head_shape(2, features=8, hidden=6, frequencies=6, box_size=0.5, sh_degree=sh_degree)
    model = HeadModel(shape, COUNT)
    for parameter in model.parameters():
        parameter.data = torch.randn_like(parameter)
    return model


@pytest.mark.parametrize("sh_degree", [0, 1])
def test_values_and_gradients_are_those_of_plain_torch(sh_degree):
    torch.manual_seed(0)
    model = _model(sh_degree)
    model.means.data = torch.rand(COUNT, 3) - 0.5
    features, expression = torch.randn(COUNT, 8), torch.zeros(2)
    pulled = torch.randn(COUNT, model.shape.outputs)
    found = []
    for dtype in (torch.float32, torch.float64):
        model = model.to(dtype)
        given = features.to(dtype).requires_grad_()
        values = model.decode(given, expression)
        parameters = dict(model.named_parameters())
        wanted = [given, model.means, *(parameters[name] for name in NAMES)]
        gradients = torch.autograd.grad(values, wanted, pulled.to(dtype))
        found.append([values.double(), *(gradient.double() for gradient in gradients)])
    for kernel, reference in zip(*found, strict=True):
        scale = reference.detach().abs().max().item()
        torch.testing.assert_close(kernel, reference, rtol=0, atol=2e-5 * scale)


def test_what_needs_no_gradient_gets_none():
    features = torch.randn(20, 4, requires_grad=True)
    first, last = (torch.randn(5, 13), torch.randn(5)), (torch.randn(4, 5), torch.randn(4))
    positions = torch.rand(20, 3)
    decode(features, positions, 1, first, last).sum().backward()
    assert features.grad is not None and positions.grad is None
    assert all(tensor.grad is None for tensor in (*first, *last))
