"""The tunable MLP: kernels and torch against loops over points and sets in float64."""

import math

import numba
import pytest
import torch

from ico3d.body.motion.tunable import MlpShape, initial_weights, positional_encoding, tunable_mlp
from ico3d.errors import SettingsError

pytestmark = pytest.mark.slow

SHAPE = MlpShape(inputs=16)
ODD = MlpShape(inputs=5, width=9, depth=3, outputs=7, sets=3)  # no whole fours anywhere
COUNT = 300  # two full blocks of the kernels and a part of one


def _case(shape: MlpShape, count: int, dtype: torch.dtype = torch.float64):
    """Weights, x and alpha that ask for gradients."""
    generator = torch.Generator().manual_seed(1)
    weights = initial_weights(shape, generator)
    x = torch.randn(count, shape.inputs, generator=generator)
    alpha = torch.randn(count, shape.sets, generator=generator)
    weights = {name: value.to(dtype).requires_grad_() for name, value in weights.items()}
    return weights, x.to(dtype).requires_grad_(), alpha.to(dtype).requires_grad_()


def _reference(weights, shape, x, alpha):
    """The paper's equation, one point and one set at a time."""
    rows = []
    for values, shares in zip(x, alpha, strict=True):
        for layer in range(shape.depth + 1):
            weight, bias = weights[f"weight{layer}"], weights[f"bias{layer}"]
            values = sum(shares[m] * (weight[m].T @ values + bias[m]) for m in range(shape.sets))
            values = values.clamp(min=0) if layer < shape.depth else values
        rows.append(values)
    return torch.stack(rows)


def _with_gradients(function, shape, count, dtype):
    """What a function gives and the gradients of all that it takes."""
    weights, x, alpha = _case(shape, count, dtype)
    generator = torch.Generator().manual_seed(2)
    towards = torch.randn(count, shape.outputs, generator=generator).to(dtype)
    out = function(weights, shape, x, alpha)
    out.backward(towards)
    gradients = {name: value.grad for name, value in weights.items()}
    return {"out": out.detach(), "x": x.grad, "alpha": alpha.grad, **gradients}


@pytest.mark.parametrize("shape", [SHAPE, ODD, MlpShape(52, depth=4, sets=1)])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_values_and_gradients_equal_the_reference(shape, dtype):
    found = _with_gradients(tunable_mlp, shape, COUNT, dtype)
    expected = _with_gradients(_reference, shape, COUNT, torch.float64)
    tolerance = 1e-5 if dtype == torch.float32 else 1e-12
    for name, value in found.items():
        assert value.dtype == dtype
        close = tolerance * expected[name].abs().max().item()
        torch.testing.assert_close(value.double(), expected[name], rtol=0, atol=close, msg=name)


def test_gradients_of_the_reference_by_finite_differences():
    shape = MlpShape(inputs=3, width=4, depth=2, outputs=2)
    weights, x, alpha = _case(shape, 2)

    def function(x, alpha, *values):
        return _reference(dict(zip(weights, values, strict=True)), shape, x, alpha)

    assert torch.autograd.gradcheck(function, (x, alpha, *weights.values()))


@pytest.mark.parametrize("chosen", range(ODD.sets))
def test_a_one_hot_alpha_selects_one_set(chosen):
    weights, x, alpha = _case(ODD, COUNT, torch.float32)
    alpha = torch.zeros_like(alpha)
    alpha[:, chosen] = 1
    expected = x
    for layer in range(ODD.depth + 1):
        linear = expected @ weights[f"weight{layer}"][chosen] + weights[f"bias{layer}"][chosen]
        expected = linear if layer == ODD.depth else linear.relu()
    found = tunable_mlp(weights, ODD, x, alpha)
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-6)
    found.sum().backward()
    for value in weights.values():
        assert value.grad is not None
        others = [m for m in range(ODD.sets) if m != chosen]
        assert not value.grad[others].any()
        assert value.grad[chosen].any()


def test_points_do_not_see_one_another():
    weights, x, alpha = _case(SHAPE, COUNT, torch.float32)
    order = torch.randperm(COUNT, generator=torch.Generator().manual_seed(3))
    whole = tunable_mlp(weights, SHAPE, x, alpha)
    assert torch.equal(tunable_mlp(weights, SHAPE, x[order], alpha[order]), whole[order])
    assert torch.equal(tunable_mlp(weights, SHAPE, x[:7], alpha[:7]), whole[:7])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_no_points(dtype):
    found = _with_gradients(tunable_mlp, SHAPE, 0, dtype)
    assert found["out"].shape == (0, SHAPE.outputs)
    assert found["x"].shape == (0, SHAPE.inputs)
    assert not found["weight0"].any()


def test_the_same_for_any_number_of_threads():
    many = numba.get_num_threads()
    first = _with_gradients(tunable_mlp, SHAPE, 3000, torch.float32)
    try:
        numba.set_num_threads(1)
        second = _with_gradients(tunable_mlp, SHAPE, 3000, torch.float32)
    finally:
        numba.set_num_threads(many)
    for name, value in first.items():
        assert torch.equal(value, second[name]), name


def test_arguments_need_not_be_contiguous_nor_ask_for_gradients():
    weights, x, alpha = _case(SHAPE, COUNT, torch.float32)
    expected = tunable_mlp(weights, SHAPE, x, alpha)
    with torch.no_grad():
        columns = tunable_mlp(weights, SHAPE, x.T.contiguous().T, alpha.T.contiguous().T)
    assert torch.equal(columns, expected)
    frozen = {name: value.detach() for name, value in weights.items()}
    tunable_mlp(frozen, SHAPE, x, alpha.detach()).sum().backward()
    assert x.grad is not None
    assert alpha.grad is None


def test_weights_begin_as_those_of_a_linear_layer_and_small_at_the_end():
    weights = initial_weights(SHAPE, torch.Generator().manual_seed(1))
    assert {name: tuple(value.shape) for name, value in weights.items()} == {
        "weight0": (2, 16, 64),
        "bias0": (2, 64),
        "weight1": (2, 64, 64),
        "bias1": (2, 64),
        "weight2": (2, 64, 10),
        "bias2": (2, 10),
    }
    bounds = {"weight0": 1 / 4, "weight1": 1 / 8, "weight2": 0.1 / 8}
    for name, bound in bounds.items():
        assert 0.9 * bound < weights[name].abs().max() <= bound
    again = initial_weights(SHAPE, torch.Generator().manual_seed(1))
    assert all(torch.equal(value, again[name]) for name, value in weights.items())
    assert not torch.equal(weights["weight0"][0], weights["weight0"][1])


def test_a_layer_without_values_is_refused():
    with pytest.raises(SettingsError, match="1 to 1,024"):
        MlpShape(inputs=16, sets=0)


def test_other_sizes_are_refused():
    weights, x, alpha = _case(SHAPE, 4, torch.float32)
    with pytest.raises(ValueError, match="weights"):
        tunable_mlp({**weights, "bias1": weights["bias0"][:, :-1]}, SHAPE, x, alpha)
    for wrong in ((x[:, 1:], alpha), (x[1:], alpha), (x, alpha[:, :1])):
        with pytest.raises(ValueError, match="alpha"):
            tunable_mlp(weights, SHAPE, *wrong)


def test_positional_encoding():
    x = torch.tensor([[0.25, -1.0]], dtype=torch.float64)
    angles = [math.pi / 4, -math.pi, math.pi / 2, -2 * math.pi]
    expected = [0.25, -1.0, *map(math.sin, angles), *map(math.cos, angles)]
    torch.testing.assert_close(positional_encoding(x, 2)[0], x.new_tensor(expected))
    assert torch.equal(positional_encoding(x, 0), x)
    assert positional_encoding(x.float(), 6).shape == (1, 2 * 13)
    x.requires_grad_()
    assert torch.autograd.gradcheck(lambda values: positional_encoding(values, 6), (x,))
