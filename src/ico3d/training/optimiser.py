"""Adam and SGD over named tensors, whose moments can be saved, split and pruned.

`torch.optim` keys its state by parameter objects and saves pickles. Here density control has to cut
moments along the Gaussians, checkpoints need names, and on the CPU an update of large tensors has
to be a single pass through memory.
"""

import math
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from ico3d.common.native.jit import prange
from ico3d.splat.cpu.compile import kernel
from ico3d.training.finite import check_gradient

BETA1 = 0.9
BETA2 = 0.999
EPSILON = 1e-15
"""Adam's ε as in 3D Gaussian splatting: gradients of positions are far below the usual 1e-8."""
KINDS = ("first", "second", "steps", "mean")
"""What the names of moments end with; `mean` is the mean over the last steps."""
BLOCK = 4096
"""Numbers that a thread updates as one block."""


class Optimiser:
    """Adam, or plain SGD, over tensors named by the caller.

    Attributes:
        kind: `adam` or `sgd`.
        moments: By name: NAME.first and NAME.second are shaped like the parameter NAME; NAME.steps
            counts the parameter's updates.
    """

    def __init__(self, kind: str = "adam"):
        """Starts without moments; a parameter's first update creates them."""
        self.kind = kind
        self.moments: dict[str, Tensor] = {}

    def update(
        self, name: str, value: Tensor, gradient: Tensor, rate: float, weight_decay: float = 0.0
    ) -> None:
        """Updates `value` in place by one step.

        Args:
            name: Name of the parameter in `moments`.
            value: The parameter, any shape, contiguous.
            gradient: Shaped as the parameter.
            rate: Learning rate.
            weight_decay: Factor by which the parameter is added to its gradient (L2).

        Raises:
            NotFiniteError: If the gradient holds NaN or infinity; then nothing is changed.
        """
        value, gradient = value.detach(), gradient.detach()
        check_gradient(name, gradient)
        if weight_decay:
            gradient = gradient + weight_decay * value
        if self.kind == "sgd":
            value.sub_(gradient, alpha=rate)
            return
        first, second, corrections = self._moments(name, value)
        if value.device.type == "cpu" and value.dtype == torch.float32:
            tensors = (value, first, second, gradient.contiguous())
            arguments = [tensor.view(-1).numpy() for tensor in tensors]  # (size,) each
            adam_kernel(*arguments, np.float32(rate), *corrections)  # type: ignore[call-arg]
        else:
            adam_reference(value, first, second, gradient, rate, corrections)

    def _moments(self, name: str, value: Tensor) -> tuple[Tensor, Tensor, tuple]:
        """Both moments and the bias corrections of this, the next update."""
        if f"{name}.first" not in self.moments:
            self.moments[f"{name}.first"] = torch.zeros_like(value)
            self.moments[f"{name}.second"] = torch.zeros_like(value)
            self.moments[f"{name}.steps"] = torch.zeros((), dtype=torch.int64)
        steps = self.moments[f"{name}.steps"]
        steps += 1
        first, second = self.moments[f"{name}.first"], self.moments[f"{name}.second"]
        return first, second, bias_corrections(int(steps))


def check_moments(
    moments: Mapping[str, Tensor],
    parameters: Mapping[str, Tensor],
    others: Mapping[str, tuple[int, ...]] = {},
) -> None:
    """Checks the moments of a checkpoint, which kernels write to as far as the parameter reaches.

    Args:
        moments: The moments by name.
        parameters: The parameters that go on with them, by name.
        others: Shapes of the moments that are not as `Optimiser` makes them, by name.

    Raises:
        ValueError: If one is of another type or shape than its parameter, or of none.
    """
    for name, moment in moments.items():
        owner, _, kind = name.rpartition(".")
        if owner not in parameters or kind not in KINDS:
            raise ValueError(f"there is no parameter of which '{name}' is a moment")
        counts, value = kind == "steps", parameters[owner]
        dtype = torch.int64 if counts else value.dtype
        shape = others.get(name, () if counts else tuple(value.shape))
        if (moment.dtype, tuple(moment.shape)) != (dtype, shape):
            found = tuple(moment.shape)
            raise ValueError(f"'{name}' is {moment.dtype} of {found}, expected {dtype} of {shape}")
        if counts and moment.numel() and int(moment.min()) < 0:
            raise ValueError(f"'{name}' counts fewer than no steps")
        needed = {"first": ("second", "steps"), "second": ("steps",)}.get(kind, ())
        for other in (f"{owner}.{part}" for part in needed):
            if other not in moments:
                raise ValueError(f"'{name}' has no '{other}' beside it")


def bias_corrections(steps: int) -> tuple[np.float32, np.float32]:
    """Corrections of Adam's first moment and of the root of its second after `steps` updates."""
    first = 1.0 / (1.0 - BETA1**steps)
    second = 1.0 / math.sqrt(1.0 - BETA2**steps)
    return np.float32(first), np.float32(second)


def adam_reference(
    value: Tensor,
    first: Tensor,
    second: Tensor,
    gradient: Tensor,
    rate: float,
    corrections: tuple,
) -> None:
    """One Adam step in plain torch, in place; `adam_kernel` does the same in a single pass."""
    first.lerp_(gradient, 1.0 - BETA1)
    second.mul_(BETA2).addcmul_(gradient, gradient, value=1.0 - BETA2)
    denominator = second.sqrt().mul_(float(corrections[1])).add_(EPSILON)
    value.addcdiv_(first, denominator, value=-rate * float(corrections[0]))


@kernel(parallel=True)
def adam_kernel(value, first, second, gradient, rate, first_correction, second_correction):
    """One Adam step over flat float32 arrays, in place.

    Work is cut into blocks whose ends do not depend on the number of threads: the last numbers of a
    loop are computed singly and round differently from those computed eight at a time.
    """
    beta1, beta2, epsilon = np.float32(BETA1), np.float32(BETA2), np.float32(EPSILON)
    rest1, rest2 = np.float32(1.0 - BETA1), np.float32(1.0 - BETA2)
    step = rate * first_correction
    for block in prange((value.size + BLOCK - 1) // BLOCK):
        for i in range(block * BLOCK, min((block + 1) * BLOCK, value.size)):
            g = gradient[i]
            m = beta1 * first[i] + rest1 * g
            v = beta2 * second[i] + rest2 * g * g
            first[i] = m
            second[i] = v
            value[i] -= step * m / (np.sqrt(v) * second_correction + epsilon)
