"""The verb `ico3d doctor`."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from ico3d.bundle import packaged
from ico3d.chat.observing.operator_log import set_up_log
from ico3d.errors import DiagnosisError, SettingsError

if TYPE_CHECKING:
    from ico3d.chat.doctor.finding import Finding


@dataclass(frozen=True)
class Doctor:
    """Checks whether this machine can serve, or a deployment from outside; says what to mend.

    Of a deployment, a visitor's way is gone: name, certificate, page, WebSocket, one conversation
    that loses its connection and is resumed. It takes a place for a moment.

    Attributes:
        url: Address of a deployment, such as https://avatar.example.org; without one, this machine
            is looked at.
        key_variable: Environment variable with the key of a deployment that asks for one.
        bundle: Avatar that this machine is to serve.
        settings: Settings file that it is to serve with.
        port: Port that it is to serve on.
    """

    url: Annotated[str, tyro.conf.Positional] = ""
    key_variable: str = ""
    bundle: Path = Path(packaged.NAME)
    settings: Path | None = None
    port: int = 8765

    def run(self) -> None:
        """Prints a line for each thing that was looked at.

        Raises:
            SettingsError: If the URL is none, or the variable holds no key.
            DiagnosisError: If something has to be mended.
        """
        set_up_log(verbose=False)
        worst = 0
        for finding in self._findings():
            Console(soft_wrap=True, highlight=False).print(finding.line())
            worst += finding.grade == "bad"
        if worst:
            raise DiagnosisError(f"{worst} of these must be mended.")

    def _findings(self) -> "Iterator[Finding]":
        from ico3d.chat.doctor import machine

        if not self.url:
            return machine.findings(self.bundle, self.settings, self.port)
        from ico3d.chat.doctor import deployment

        key = os.environ.get(self.key_variable, "")
        if self.key_variable and not key:
            raise SettingsError(f"the environment variable {self.key_variable} holds no key.")
        return deployment.findings(self.url, key)
