"""Reads PyTorch's files of weights (.pth, .pt, .bin), in which torch unpacks what is packed."""

import pickle
import re
import tarfile
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

from ico3d.common.unpacking.pickles import check_pickles
from ico3d.common.unpacking.zips import check_directory
from ico3d.errors import ModelError

NEEDED = re.compile(
    r"collections OrderedDict|torch (\w+Storage|[a-z]+\d+\w*|half|float|double|bool|long|Size)"
    r"|torch device"
    r"|torch\.storage \w+Storage|torch\.nn\.parameter Parameter"
    r"|torch\._utils _rebuild_(tensor|tensor_v2|parameter)"
)
"""Names that files of weights give: kinds of numbers, and what makes tensors of those in the file.
Of others some make as many bytes as they are told."""
OLD_PICKLES = 5
"""Pickles at the beginning of a file of PyTorch before 1.6: a mark, a version, what wrote it, the
objects, and the keys of the numbers behind."""
OLD = pickle.dumps(0x1950A86A20F9469CFC6C, 2)
"""How such a file begins."""
ZIP = b"PK\3\4"
"""How a file begins that torch takes for an archive; it has no packed parts in other ones."""


def check_unpacked(path: Path) -> None:
    """Refuses a file of weights that becomes much larger: torch itself packs none.

    Raises:
        ModelError: If it is packed, names or has more than models do, or is damaged.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        try:
            if file.read(len(ZIP)) == ZIP:
                _check_archive(path, file)
            else:
                file.seek(0)
                _check_old(path, file)
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            raise ModelError(f"{path} is a damaged file of weights: {error}") from error


def _check_archive(path: Path, file: BinaryIO) -> None:
    check_directory(file)
    with zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        packed = any(entry.compress_type != zipfile.ZIP_STORED for entry in entries)
        if packed or sum(entry.file_size for entry in entries) > path.stat().st_size:
            raise ModelError(
                f"{path} is packed, as no file is that PyTorch writes: it is not read."
            )
        names = [entry.filename.lower() for entry in entries]
        if len(set(names)) < len(names):  # torch does not tell them apart, and takes any
            raise ModelError(f"{path} has two parts of one name: it is not read.")
        for entry, name in zip(entries, names, strict=True):
            if name.endswith(".pkl"):
                with archive.open(entry) as pickled:
                    check_pickles(pickled, 1, NEEDED, str(path), path.stat().st_size)


def _check_old(path: Path, file: BinaryIO) -> None:
    """A file of PyTorch before 1.6; torch first tries whether it is one of before 0.1, a tar."""
    head = file.read(tarfile.BLOCKSIZE)
    if not head.startswith(OLD):
        raise ValueError("it does not begin as PyTorch begins one")
    try:
        tarfile.TarInfo.frombuf(head, tarfile.ENCODING, "surrogateescape")
    except tarfile.HeaderError:
        file.seek(0)
        check_pickles(file, OLD_PICKLES, NEEDED, str(path), path.stat().st_size)
    else:
        raise ModelError(f"{path} passes for two kinds of files: it is not read.")


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
