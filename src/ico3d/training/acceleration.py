"""Faster arithmetic for a model's networks: bfloat16 on CUDA, and torch.compile."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ico3d.errors import SettingsError


def accelerated(
    network: Callable[..., Tensor], device: torch.device, mixed_precision: bool, compiled: bool
) -> Callable[..., Tensor]:
    """A function that computes the same as a network, but faster.

    Only the network runs faster: rendering and losses stay in float32, as do the parameters, their
    gradients and the network's outputs. bfloat16 has the range of float32, so losses need no
    scaling.

    Args:
        network: A function of tensors that returns a tensor; sizes of first axes may change between
            calls.
        device: The device that the network runs on.
        mixed_precision: Whether matrix products run in bfloat16; without effect on the CPU.
        compiled: Whether to use torch.compile, which takes half a minute at the first call.

    Returns:
        The fast function; the network itself if neither option has an effect.

    Raises:
        SettingsError: If `compiled` is set and there is no C++ compiler.
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


def _kept() -> Path:
    """A folder of the user's own for compiled code."""
    folder = Path.home() / ".cache" / "ico3d" / "compiled"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


def _compiled(network: Callable[..., Tensor]) -> Callable[..., Tensor]:
    names = [os.environ["CXX"]] if "CXX" in os.environ else ["g++", "clang++"]
    if not any(map(shutil.which, names)):
        raise SettingsError(
            f"--compile needs a C++ compiler ({' or '.join(names)}), and none is on the PATH: "
            "install one, or leave --compile out."
        )
    from torch._inductor import config  # takes seconds

    # By default it lies where other users of the machine may be before us, and is run; headers lie
    # there in any case.
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", str(_kept()))
    config.cpp_cache_precompile_headers = False
    # The number of Gaussians is the first axis of parameters, and density control changes it.
    torch._dynamo.config.force_parameter_static_shapes = False
    return torch.compile(network, dynamic=True)
