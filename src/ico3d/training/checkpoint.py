"""Checkpoints: tensors and a JSON state in one safetensors file, written atomically."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from ico3d.common.files import write_atomic
from ico3d.errors import ModelError


def save_tensors(path: Path, tensors: dict[str, Tensor], state: dict) -> None:
    """Writes tensors and a JSON-serialisable state into one file, atomically."""
    contiguous = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    write_atomic(path, save(contiguous, metadata={"state": json.dumps(state)}))


def load_tensors(path: Path) -> tuple[dict[str, Tensor], dict]:
    """Reads the tensors, onto the CPU, and the state that `save_tensors` wrote.

    Raises:
        ModelError: If the file is missing, damaged, or no checkpoint.
    """
    with _opened(path) as file:
        state = json.loads((file.metadata() or {})["state"])
        return {name: file.get_tensor(name) for name in file.keys()}, state  # noqa: SIM118


def placed(tensors: dict[str, Tensor], place: Callable[[str], torch.device]) -> dict[str, Tensor]:
    """Moves each tensor of a checkpoint to the device that `place` returns for its name.

    Scalar integers stay on the CPU: they count steps, and the optimiser reads them at every step.
    """
    return {
        name: tensor.to(place(name)) if tensor.is_floating_point() or tensor.dim() else tensor
        for name, tensor in tensors.items()
    }


def load_state(path: Path) -> dict:
    """Reads only the state of a checkpoint, not its tensors; errors as for `load_tensors`."""
    with _opened(path) as file:
        return json.loads((file.metadata() or {})["state"])


@contextmanager
def _opened(path: Path) -> Iterator[safe_open]:
    if not path.is_file():
        raise ModelError(f"there is no model file at {path}.")
    try:
        with safe_open(path, framework="pt") as file:
            yield file
    except (SafetensorError, KeyError, ValueError, OSError) as error:
        raise ModelError(
            f"{path} is damaged or no file of ico3d ({error}): train again."
        ) from error
