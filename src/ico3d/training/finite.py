"""Finding NaN and infinity early: before an update, naming the parameter."""

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from ico3d.errors import ModelError


class NotFiniteError(ModelError):
    """Optimisation has met NaN or infinity.

    Attributes:
        what: The tensor that holds one, in words.
    """

    def __init__(self, what: str):
        """Names the tensor; the loop adds step and checkpoint."""
        super().__init__(f"{what} is not finite.")
        self.what = what

    def at(self, step: int, saved: int) -> ModelError:
        """The sentence for the user of a run whose latest checkpoint is of step `saved`."""
        return ModelError(
            f"{self.what} is not finite at step {step}: look for damaged frames with ico3d "
            f"capture check and run the same command again (it goes on from step {saved}), "
            "or start afresh with lower learning rates."
        )


def check_gradient(name: str, gradient: Tensor) -> None:
    """Looks for NaN and infinity before a parameter takes them over.

    Raises:
        NotFiniteError: If the gradient holds one.
    """
    if not _is_finite(gradient):
        raise NotFiniteError(f"the gradient of '{name}'")


def check_finite(tensors: Mapping[str, Tensor]) -> None:
    """Looks for NaN and infinity.

    Raises:
        NotFiniteError: Naming the first tensor that holds one.
    """
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not _is_finite(tensor):
            raise NotFiniteError(f"'{name}'")


def _is_finite(tensor: Tensor) -> bool:
    """A sum tells in a thirtieth of the time, unless it overflows by itself."""
    total = tensor.detach().sum()
    return math.isfinite(total.item()) or bool(torch.isfinite(tensor).all())
