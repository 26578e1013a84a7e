"""What a training says when its GPU fails."""

import torch

from ico3d.errors import DeviceError

SIGNS = ("CUDA error", "CUDA driver error", "cuDNN error", "CUBLAS_STATUS", "NCCL error")
"""How messages of PyTorch and gsplat about a failed GPU begin or what they contain."""


def device_failure(error: RuntimeError, step: int, saved: int) -> DeviceError | None:
    """The sentence for an error of a GPU; None for an error of another kind.

    Args:
        error: What a step raised.
        step: The number of this step.
        saved: The step after which the run's latest checkpoint was written; 0 before the first.
    """
    again = f"run the same command again, and it goes on from step {saved}"
    said = str(error).strip().partition("\n")[0]
    if isinstance(error, torch.OutOfMemoryError):
        fewer = f" Then {again}, or start afresh with fewer --density.max-gaussians."
        return DeviceError.of("gpu-memory", after=fewer, values={"step": step})
    if isinstance(error, torch.AcceleratorError) or any(sign in said for sign in SIGNS):
        after = f" It said: {said}. Now {again}."
        return DeviceError.of("gpu-failed", after=after, values={"step": step})
    return None
