"""Detects NaN and infinity before an update, and names the parameter."""

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from ico3d.errors import ModelError


class NotFiniteError(ModelError):
    """Optimisation has met NaN or infinity.

    Attributes:
        what: The tensor that holds NaN or infinity, in words.
    """

    def __init__(self, what: str):
        """Names the tensor; the training loop adds step and checkpoint."""
        super().__init__(f"{what} is not finite.")
        self.what = what

    def at(self, step: int, saved: int) -> ModelError:
        """The error for the user; the run's latest checkpoint was written after step `saved`."""
        return ModelError.of(
            "diverged",
            f"{self.what} is not finite at step {step}: ",
            " Look for these with ico3d capture check and run the same command again (it goes on "
            f"from step {saved}), or start afresh with lower learning rates.",
        )


def check_gradient(name: str, gradient: Tensor) -> None:
    """Refuses a parameter's gradient that holds NaN or infinity; call before the update.

    Raises:
        NotFiniteError: If the gradient holds NaN or infinity.
    """
    if not all_finite(gradient):
        raise NotFiniteError(f"the gradient of '{name}'")


def check_finite(tensors: Mapping[str, Tensor]) -> None:
    """Refuses named tensors that hold NaN or infinity.

    Raises:
        NotFiniteError: At the first tensor that holds NaN or infinity.
    """
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not all_finite(tensor):
            raise NotFiniteError(f"'{name}'")


def all_finite(tensor: Tensor) -> bool:
    """Whether a tensor holds neither NaN nor infinity.

    A sum tells in a thirtieth of the time, unless it overflows by itself.
    """
    total = tensor.detach().sum()
    return math.isfinite(total.item()) or bool(torch.isfinite(tensor).all())
