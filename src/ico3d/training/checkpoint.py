"""Checkpoints: tensors and a JSON state in one safetensors file, written atomically."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor, nn

from ico3d.common.files import write_one_of_many
from ico3d.common.typed import loose_json
from ico3d.common.unpacking.heads import check_head
from ico3d.common.unpacking.memory import lacks_room
from ico3d.errors import ModelError
from ico3d.training.finite import all_finite

DTYPES = {
    torch.float64: "F64",
    torch.float32: "F32",
    torch.float16: "F16",
    torch.bfloat16: "BF16",
    torch.int64: "I64",
    torch.int32: "I32",
    torch.int16: "I16",
    torch.int8: "I8",
    torch.uint8: "U8",
    torch.bool: "BOOL",
}
"""The names that the safetensors format has for types of numbers."""
DAMAGED = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RuntimeError,
)
"""What reading values out of a model's JSON and tensors raises where they are damaged."""
Size = tuple[int | None, ...]
"""The shape that a tensor must have; None is any number."""
ALIGNMENT = 8
"""The header of a safetensors file ends at a multiple of this many bytes."""
SEAL = "sha256"
"""Entry of a sealed file's metadata: the hash of the whole file with zeros in this place."""
_SEALED = f'{{"__metadata__":{{"{SEAL}":"'.encode()
"""How the header of a sealed file begins, behind its length in eight bytes."""
_UNSEALED = b'{"__metadata__":{"state"'
"""How that of a file without a hash begins."""
MOST_VALUES = 1 << 26
"""Values of a layer, of all Gaussians together: 268 MB."""
FARTHEST = 1e4
"""Largest distance of a position from the origin, metres: squares of it stay numbers."""
_NO_SEAL = b"0" * 64
_CHUNK = 1 << 20
_COPIES = 4
"""So often may a file's tensors lie in memory at once, while a model is made of them and shown."""


def save_tensors(path: Path, tensors: Mapping[str, Tensor], state: dict) -> None:
    """Writes tensors and a JSON-serialisable state into one file, atomically.

    The tensors go to the disk one by one: beside them, memory holds at most a copy of one of them.

    Raises:
        StorageError: If the disk is full, or would nearly be; a file that was there before is kept.
    """
    size = size_of_tensors(tensors)
    write_one_of_many(path, lambda temporary: _stream(temporary, tensors, {}, state), size)


def save_sealed(
    path: Path, tensors: Mapping[str, Tensor], state: dict, before: Path | None = None
) -> None:
    """Does as `save_tensors`, and adds a hash by which `load_sealed` finds any damage.

    Args:
        path: The file to write.
        tensors: Tensors by name.
        state: What else is to be kept; JSON-serialisable.
        before: Name that a file which was there before gets; None replaces it.

    Raises:
        StorageError: If the disk is full, or would nearly be; a file that was there before is kept.
    """

    def write(temporary: Path) -> None:
        _stream(temporary, tensors, {SEAL: _NO_SEAL.decode()}, state)
        with temporary.open("r+b") as file:
            found = _hash(file)
            file.seek(8 + len(_SEALED))
            file.write(found)

    write_one_of_many(path, write, size_of_tensors(tensors), before)


def size_of_tensors(tensors: Mapping[str, Tensor]) -> int:
    """Bytes that tensors take in memory and, but for a header, in a file."""
    return sum(tensor.numel() * tensor.element_size() for tensor in tensors.values())


def _stream(path: Path, tensors: Mapping[str, Tensor], more: dict[str, str], state: dict) -> None:
    """Writes a safetensors file piece by piece; its metadata begin with `more`.

    The functions of the safetensors package first copy all tensors of a GPU into memory.
    """
    # Wide numbers first: each tensor begins at a multiple of the size of its numbers.
    names = sorted(tensors, key=lambda name: (-tensors[name].element_size(), name))
    header: dict[str, dict] = {"__metadata__": more | {"state": json.dumps(state)}}
    end = 0
    for name in names:
        tensor, begin = tensors[name], end
        end += tensor.numel() * tensor.element_size()
        shape, kind = list(tensor.shape), DTYPES[tensor.dtype]
        header[name] = {"dtype": kind, "shape": shape, "data_offsets": [begin, end]}
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % ALIGNMENT)
    with path.open("wb") as file:
        file.write(len(text).to_bytes(8, "little"))
        file.write(text)
        for name in names:
            flat = tensors[name].detach().cpu().contiguous().reshape(-1)  # (all numbers,)
            file.write(flat.view(torch.uint8).numpy().data)


def load_tensors(path: Path) -> tuple[dict[str, Tensor], dict]:
    """Reads the tensors, onto the CPU, and the state that `save_tensors` wrote.

    Raises:
        ModelError: If the file is missing, damaged, no checkpoint, or too large for this machine.
    """
    with _opened(path) as file:
        _check_room(path)
        state = loose_json((file.metadata() or {})["state"])
        return {name: file.get_tensor(name) for name in file.keys()}, state  # noqa: SIM118


def _check_room(path: Path) -> None:
    """Refuses a file that takes all of the memory."""
    lacking = lacks_room(path, _COPIES)
    if lacking:
        raise ModelError(f"{path} {lacking}.")


def load_sealed(path: Path) -> tuple[dict[str, Tensor], dict]:
    """Reads what `save_sealed` wrote, or an earlier version without a hash.

    Raises:
        ModelError: As for `load_tensors`, and if anything in the file has changed.
    """
    check_seal(path)
    return load_tensors(path)


def check_seal(path: Path) -> None:
    """Raises ModelError if the file is missing, no safetensors file, or has changed."""
    with _opened(path, ""), path.open("rb") as file:
        head = file.read(8 + len(_SEALED))
        seal = file.read(len(_NO_SEAL))
        sealed = head[8:] == _SEALED
        if not (seal == _hash(file) if sealed else head[8:].startswith(_UNSEALED)):
            raise ValueError("its content does not fit its hash")


def _hash(file: BinaryIO) -> bytes:
    """The hash of a sealed file, in hexadecimal digits."""
    file.seek(0)
    found = hashlib.sha256(file.read(8 + len(_SEALED)) + _NO_SEAL)
    file.seek(len(_NO_SEAL), os.SEEK_CUR)
    while chunk := file.read(_CHUNK):
        found.update(chunk)
    return found.hexdigest().encode()


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
        return loose_json((file.metadata() or {})["state"])


def check_shapes(build: Callable[[], nn.Module], tensors: Mapping[str, Tensor]) -> None:
    """Compares the tensors of a file with those of a network, for which no memory is taken.

    A file of a few bytes can describe a network of any size.

    Args:
        build: Makes the network that the file describes.
        tensors: The tensors of the file.

    Raises:
        ValueError: If a tensor is missing, superfluous or of another shape.
    """
    with torch.device("meta"):
        wanted = {name: tuple(value.shape) for name, value in build().state_dict().items()}
    found = {name: tuple(value.shape) for name, value in tensors.items()}
    for name in sorted(wanted.keys() | found.keys()):
        if wanted.get(name) != found.get(name):
            raise ValueError(
                f"'{name}' has the shape {found.get(name)}, expected {wanted.get(name)}"
            )


def check_places(places: Tensor) -> None:
    """Checks positions of a file: farther out, what is computed of them is no number any more.

    Args:
        places: (N, 3) metres.

    Raises:
        ValueError: If one lies more than `FARTHEST` metres from the origin.
    """
    if not (places.abs() <= FARTHEST).all():  # also where one is NaN
        raise ValueError(f"'means' lie more than {FARTHEST:,.0f} m from the origin")


def check_width(count: int, *widths: int) -> None:
    """Checks how much is computed of all Gaussians at once, which no file's size tells.

    Args:
        count: Number of Gaussians.
        widths: Sizes of layers.

    Raises:
        ValueError: If a layer has more than `MOST_VALUES` of all of them.
    """
    if count * max(widths) > MOST_VALUES:
        raise ValueError(f"layers of {max(widths)} values of {count} Gaussians are too large")


def check_tensor(name: str, tensor: Tensor, size: Size, below: int | None = None) -> None:
    """Checks one tensor of a file: kernels read it without looking at its bounds.

    Args:
        name: Its name.
        tensor: The tensor.
        size: Its shape.
        below: What its numbers are smaller than, and then they are int32 and not negative; None
            for float32, all finite.

    Raises:
        ValueError: If it is something else.
    """
    kind = torch.float32 if below is None else torch.int32
    found = tuple(tensor.shape)
    fits = len(found) == len(size) and all(w in (None, n) for n, w in zip(found, size, strict=True))
    if tensor.dtype != kind or not fits:
        text = ", ".join("…" if n is None else str(n) for n in size)
        raise ValueError(f"'{name}' is {tensor.dtype} of {found}, expected {kind} of ({text})")
    if below is None:
        if not all_finite(tensor):
            raise ValueError(f"'{name}' holds NaN or infinity")
    elif tensor.numel() and not 0 <= int(tensor.min()) <= int(tensor.max()) < below:
        raise ValueError(f"'{name}' holds a number that is not from 0 to {below - 1}")


@contextmanager
def _opened(path: Path, advice: str = ": train again") -> Iterator[safe_open]:
    try:
        if not os.path.isfile(path):
            raise ModelError(f"there is no model file at {path}.")
        check_head(path)
        with safe_open(path, framework="pt") as file:
            yield file
    except (SafetensorError, *DAMAGED) as error:
        raise ModelError(f"{path} is damaged or no file of ico3d ({error}){advice}.") from error
