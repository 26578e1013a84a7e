"""Reads PyTorch's files of weights (.pth, .pt, .bin), in which torch unpacks what is packed."""

import zipfile
from pathlib import Path
from typing import Any

from ico3d.common.unpacking.zips import check_directory
from ico3d.errors import ModelError

ZIP = b"PK\3\4"
"""How a file begins that torch takes for an archive; it has no packed parts in other ones."""


def check_unpacked(path: Path) -> None:
    """Refuses a file of weights that is larger unpacked: torch itself packs none.

    Raises:
        ModelError: If it is, or is a damaged archive.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        if file.read(len(ZIP)) != ZIP:
            return
        try:
            check_directory(file)
            with zipfile.ZipFile(file) as archive:
                entries = archive.infolist()
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            raise ModelError(f"{path} is a damaged file of weights: {error}") from error
    packed = any(entry.compress_type != zipfile.ZIP_STORED for entry in entries)
    if packed or sum(entry.file_size for entry in entries) > path.stat().st_size:
        raise ModelError(f"{path} is packed, as no file is that PyTorch writes: it is not read.")


def load_weights(path: Path, device: Any = "cpu") -> Any:
    """What is in a file of weights; nothing that the file asks for is run.

    Args:
        path: A file that `torch.save` wrote.
        device: Where the tensors are to be, a name or a `torch.device`.

    Raises:
        ModelError: If it is larger unpacked (`check_unpacked`).
        Exception: Of many kinds, as torch raises for damaged files.
    """
    import torch

    check_unpacked(path)
    return torch.load(path, map_location=device, weights_only=True)  # pyright: ignore[reportUnknownMemberType]
