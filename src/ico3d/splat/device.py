"""Chooses the device to compute on, for all verbs; CUDA is used only after a successful trial."""

# pyright: reportUnknownMemberType=false
# (torch leaves some of its functions untyped)

import sys
from functools import cache

import numpy as np
import torch

from ico3d.common.camera import Camera
from ico3d.common.device import DeviceName
from ico3d.errors import Ico3dError, SettingsError
from ico3d.splat.convention import BLUR, MAX_ALPHA
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

CPU = torch.device("cpu")
TRIED = ((30.0, 1.0), (0.06, 0.9))
"""Standard deviations in pixels, and opacities, of splats that are drawn to try CUDA: alpha is at
its upper bound in the middle of the first, the low-pass takes nearly all of the second."""
SIZE = 17
"""Side of the trial pictures in pixels; odd, so that one pixel lies in the centre."""
TOLERANCE = 1e-4


def computing_device(wanted: DeviceName = "auto") -> torch.device:
    """The device to compute on.

    Args:
        wanted: `auto` takes CUDA if a trial rendering and its gradients are right there. If a CUDA
            device exists but fails the trial, the reason is printed once and the CPU is taken.

    Raises:
        SettingsError: If `cuda` is wanted and does not work.
    """
    if wanted == "cpu":
        return CPU
    fault = cuda_fault()
    if fault is None:
        return torch.device("cuda")
    if wanted == "cuda":
        raise SettingsError(f"--device cuda does not work here: {fault}")
    if torch.cuda.is_available():
        _say_once(fault)
    return CPU


def decided(wanted: DeviceName) -> DeviceName:
    """`cpu` or `cuda`: the device that `computing_device` chooses, by name, for other processes.

    Raises what `computing_device` raises.
    """
    return "cuda" if computing_device(wanted).type == "cuda" else "cpu"


def device_name(device: torch.device) -> str:
    """The device in words: `cpu`, or `cuda` with the name of the GPU."""
    return "cpu" if device.type == "cpu" else f"cuda ({torch.cuda.get_device_name(device)})"


def wait_for(device: torch.device) -> None:
    """Returns once a device has done what it was told to do; the CPU has already."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)


@cache
def cuda_fault() -> str | None:
    """Why CUDA cannot be used, as the end of a sentence; None if it can."""
    if not torch.cuda.is_available():
        return "torch finds no CUDA device."
    try:
        for pixels, opacity in TRIED:
            _check(pixels, opacity)
    except Ico3dError as error:
        return str(error)
    except Exception as error:  # of many kinds: drivers, compilers, memory
        reason = str(error).strip().split("\n")[0]
        return f"gsplat fails to render ({type(error).__name__}: {reason})."
    return None


def _check(pixels: float, opacity: float) -> None:
    """Draws a round splat and compares alpha in its middle, and its slope, with the formulas.

    Raises:
        SettingsError: If they differ.
    """
    half = SIZE / 2
    intrinsics = np.array([[SIZE, 0, half], [0, SIZE, half], [0, 0, 1.0]])
    opacities = torch.tensor([opacity], device="cuda", requires_grad=True)
    splat = Gaussians(
        torch.tensor([[0.0, 0, 1]], device="cuda"),
        torch.tensor([[1.0, 0, 0, 0]], device="cuda"),
        torch.full((1, 3), pixels / SIZE, device="cuda"),
        opacities,
        torch.ones(1, 3, device="cuda"),
    )
    drawn = render(splat, [Camera(SIZE, SIZE, intrinsics, np.eye(4))])
    alpha = drawn.alpha[0, SIZE // 2, SIZE // 2]
    alpha.backward()
    assert opacities.grad is not None
    share = pixels**2 / (pixels**2 + BLUR)  # that the low-pass leaves
    bounded = opacity * share > MAX_ALPHA
    wanted = (MAX_ALPHA, 0.0) if bounded else (opacity * share, share)
    found = (float(alpha.detach()), float(opacities.grad[0]))
    if not np.allclose(found, wanted, rtol=0, atol=TOLERANCE):
        raise SettingsError(
            f"gsplat draws other pictures than the CPU does (alpha {found[0]:.4f} with slope "
            f"{found[1]:.4f}, expected {wanted[0]:.4f} and {wanted[1]:.4f})."
        )


@cache
def _say_once(fault: str) -> None:
    print(f"computing on the CPU, not on the CUDA device: {fault}", file=sys.stderr)
