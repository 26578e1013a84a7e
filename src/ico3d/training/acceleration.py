"""Faster arithmetic for the networks of a model: bfloat16 on CUDA, and torch.compile."""

import os
import shutil
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from ico3d.errors import SettingsError


def accelerated(
    network: Callable[..., Tensor], device: torch.device, mixed_precision: bool, compiled: bool
) -> Callable[..., Tensor]:
    """A copy of a network that computes what the network does, faster.

    Only the network is touched: kernels and losses stay in float32, and so do the parameters,
    their gradients and what the network gives. bfloat16 has the range of float32, so that no loss
    needs scaling.

    Args:
        network: From tensors to a tensor; the first axis of any may change from call to call.
        device: Where it runs.
        mixed_precision: Whether its matrix products run in bfloat16. On the CPU nothing changes.
        compiled: Whether torch.compile makes its code: at the first call, half a minute.

    Returns:
        The network itself where nothing is to change.

    Raises:
        SettingsError: If it shall be compiled and there is no compiler.
    """
    mixed = mixed_precision and device.type == "cuda"
    if compiled:
        network = _compiled(network)
    if not mixed:
        return network

    def run(*arguments: Any) -> Tensor:
        with torch.autocast(device.type, torch.bfloat16):
            return network(*arguments).float()

    return run


def _compiled(network: Callable[..., Tensor]) -> Callable[..., Tensor]:
    names = [os.environ["CXX"]] if "CXX" in os.environ else ["g++", "clang++"]
    if not any(map(shutil.which, names)):
        raise SettingsError(
            f"compile=true needs a C++ compiler ({' or '.join(names)}), and none is on the PATH: "
            "install one, or leave compile out."
        )
    # The number of Gaussians is the first axis of parameters, and density control changes it.
    torch._dynamo.config.force_parameter_static_shapes = False
    return torch.compile(network, dynamic=True)
