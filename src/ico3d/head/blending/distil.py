"""Fits small networks that map an expression to a few coefficients."""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ico3d.common.expression import LEAKY_SLOPE
from ico3d.training.optimiser import Optimiser

_BATCH, _RATE = 512, 1e-2
_NAMES = ("w1", "b1", "w2", "b2")


@dataclass(frozen=True)
class CoefficientNetwork:
    """c(e) = LeakyReLU(e·w1 + b1)·w2 + b2 (docs/bundle.md), from B values to K coefficients.

    Attributes:
        w1: (B, H) float32.
        b1: (H,) float32.
        w2: (H, K) float32.
        b2: (K,) float32.
    """

    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray


def augmented(expressions: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Expressions between and around recorded ones, as playback and blinking make them.

    Args:
        expressions: (T, B) recorded expressions.
        count: Number of expressions to make.
        rng: Source of randomness.

    Returns:
        (count, B) float32. Each is a mixture of two recorded expressions, plus noise of a tenth of
        the standard deviation of each value; half of them take the eye values (the last seven)
        from a third recorded expression.
    """
    first, second, third = (expressions[rng.integers(len(expressions), size=count)] for _ in "abc")
    share = rng.uniform(0, 1, (count, 1))
    mixed = share * first + (1 - share) * second  # (count, B)
    mixed += 0.1 * expressions.std(axis=0) * rng.normal(size=mixed.shape)
    swap = rng.uniform(size=count) < 0.5
    mixed[swap, -7:] = third[swap, -7:]
    return mixed.astype(np.float32)


def distil(
    expressions: np.ndarray, scores: np.ndarray, hidden: int, steps: int, seed: int
) -> CoefficientNetwork:
    """Fits the network to pairs of expressions and scores.

    The basis is orthonormal in the weighted norm, so the squared error of the scores is the
    weighted squared error of the logits, and components need no weights. Adam finds the hidden
    layer; the output layer is then solved for by ridge regression.

    Args:
        expressions: (S, B) expressions.
        scores: (S, K) scores of each expression, see `lowrank.LowRank`.
        hidden: H, width of the hidden layer.
        steps: Steps of Adam, with 512 pairs each.
        seed: Seed of the initial weights and of the batches.
    """
    centre, spread = expressions.mean(axis=0), np.maximum(expressions.std(axis=0), 1e-3)
    size = max(float(np.sqrt(np.square(scores).sum(axis=1).mean())), 1e-12)
    inputs = torch.from_numpy(((expressions - centre) / spread).astype(np.float32))  # (S, B)
    targets = torch.from_numpy((scores / size).astype(np.float32))  # (S, K)
    with _one_thread():
        w1, b1, w2, b2 = _descend(inputs, targets, hidden, steps, seed)
    w2, b2 = _solve_output(_hidden(inputs, w1, b1), targets)
    first = w1.numpy() / spread[:, None]  # (B, H)
    return CoefficientNetwork(
        first.astype(np.float32),
        (b1.numpy() - centre @ first).astype(np.float32),
        (w2.numpy() * size).astype(np.float32),
        (b2.numpy() * size).astype(np.float32),
    )


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Limits torch to one thread: with matrices this small, more threads are slower."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _hidden(inputs: Tensor, w1: Tensor, b1: Tensor) -> Tensor:
    return torch.nn.functional.leaky_relu(inputs @ w1 + b1, LEAKY_SLOPE)  # (S, H)


def _descend(
    inputs: Tensor, targets: Tensor, hidden: int, steps: int, seed: int
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    size_in, size_out = inputs.shape[1], targets.shape[1]
    weights = (
        torch.randn(size_in, hidden, generator=generator) * size_in**-0.5,
        torch.randn(hidden, generator=generator) * 0.5,
        torch.randn(hidden, size_out, generator=generator) * hidden**-0.5 * 0.1,
        targets.mean(dim=0).clone(),
    )
    for weight in weights:
        weight.requires_grad_(True)
    optimiser = Optimiser()  # importing torch's own optimisers takes seconds
    w1, b1, w2, b2 = weights
    for step in range(steps):
        batch = torch.randint(len(inputs), (_BATCH,), generator=generator)
        error = _hidden(inputs[batch], w1, b1) @ w2 + b2 - targets[batch]  # (batch, K)
        gradients = torch.autograd.grad(error.square().sum(dim=1).mean(), weights)
        rate = _RATE * 0.5 * (1 + math.cos(math.pi * step / steps))
        for name, weight, gradient in zip(_NAMES, weights, gradients, strict=True):
            optimiser.update(name, weight, gradient, rate)
    return w1.detach(), b1.detach(), w2.detach(), b2.detach()


def _solve_output(hidden: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    """Ridge regression of targets (S, K) on the hidden layer (S, H), in float64: w2 and b2."""
    ones = torch.ones(len(hidden), 1, dtype=torch.float64)
    features = torch.cat([hidden.double(), ones], dim=1)  # (S, H + 1)
    gram = features.T @ features  # (H + 1, H + 1)
    gram += 1e-6 * gram.diagonal().mean() * torch.eye(len(gram), dtype=torch.float64)
    solution = torch.linalg.solve(gram, features.T @ targets.double())  # (H + 1, K)
    return solution[:-1].float(), solution[-1].float()
