"""Who can reach a server: checks of its options, and what is said about it at its start."""

import io
import ipaddress
import re
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import segno

from ico3d.chat.serving.guard import LOOPBACK
from ico3d.chat.serving.network.addresses import machine_addresses
from ico3d.chat.serving.network.certificates import (
    Certificate,
    given_certificate,
    own_certificate,
    state_folder,
)
from ico3d.errors import SettingsError

HOST_NAME = re.compile(r"(?!-)[a-z0-9-]{1,63}(?<!-)(\.(?!-)[a-z0-9-]{1,63}(?<!-))*")
QUIET_ZONE = 2  # modules around a QR code


@dataclass(frozen=True)
class Reach:
    """Where a server can be reached.

    Attributes:
        host: Address to which it is bound.
        names: Host names that the operator gave, in lower case.
        own_names: Names of the machine itself, in lower case; empty on loopback.
        certificate: Certificate for HTTPS; None for HTTP.
    """

    host: str
    names: tuple[str, ...] = ()
    own_names: tuple[str, ...] = ()
    certificate: Certificate | None = None

    @property
    def answered(self) -> tuple[str, ...]:
        """All names, besides its addresses, under which the server answers."""
        return (*self.names, *self.own_names)

    @property
    def scheme(self) -> str:
        """`http` or `https`."""
        return "https" if self.certificate else "http"

    def urls(self, port: int) -> list[str]:
        """Addresses for other machines, the likeliest first; empty on loopback."""
        if self.host in LOOPBACK:
            return []
        hosts = [*self.names, *machine_addresses(self.host), *self.own_names]
        return [f"{self.scheme}://{f'[{h}]' if ':' in h else h}:{port}/" for h in hosts]

    def told(self, port: int, asks_for_tokens: bool = False) -> list[str]:
        """Sentences for the operator: who can reach the server, and what they have to know."""
        admission = "who has a token can talk" if asks_for_tokens else "can talk: no password"
        lines = []
        if self.host in LOOPBACK and self.names:
            lines.append(
                "This machine reaches it, and so does everybody whom a proxy or tunnel lets "
                f"through as {' or '.join(self.names)}; everybody {admission}."
            )
        elif self.host in LOOPBACK:
            lines.append(
                "Only this machine reaches it; --host 0.0.0.0 --tls opens it for a phone beside it."
            )
        else:
            urls = self.urls(port)
            lines.append(
                f"All devices in this machine's networks reach it; everybody {admission}. "
                "On other devices it is at"
            )
            lines += [f"  {url}" for url in urls]
            if urls:
                lines += ["", *qr_code(urls[0]), ""]
            if self.certificate is None:
                lines.append(
                    "Browsers give their microphone only to HTTPS pages: without --tls, visitors "
                    "on other devices can only type."
                )
        if self.certificate is not None and self.certificate.own:
            lines += [
                "This machine has made the certificate itself, so each browser asks once whether "
                "to go on: choose »Advanced« or »Show details«, then »Proceed« or »Visit this "
                "website«. To be sure that it is this server, compare the SHA-256 fingerprint:",
                f"  {self.certificate.fingerprint}",
            ]
        return lines


def find_reach(
    host: str,
    names: Sequence[str],
    tls: bool,
    cert: Path | None,
    key: Path | None,
    folder: Path | None = None,
    now: datetime | None = None,
) -> Reach:
    """Checks the options of a server and gets its certificate.

    Args:
        host: Address to which it is bound.
        names: Host names of `--name`.
        tls: Whether a certificate is to be made if none is given.
        cert: File of a certificate, or None.
        key: File of its private key, or None.
        folder: Where an own certificate is kept; by default the user's state folder.
        now: The time, with its zone; by default that of the machine.

    Raises:
        SettingsError: If a name is not a host name, or a certificate cannot be used.
    """
    now = now or datetime.now(UTC)
    names = tuple(dict.fromkeys(map(checked_name, names)))
    machine = own_names(host)
    if (cert is None) != (key is None):
        raise SettingsError("--tls-cert and --tls-key belong together: give both or neither.")
    if cert is not None and key is not None:
        certificate = given_certificate(cert, key, now)
        own = [name for name in certificate.names if HOST_NAME.fullmatch(name)]
        outside = [name for name in own if name not in LOOPBACK]
        return Reach(host, tuple(dict.fromkeys([*names, *outside])), machine, certificate)
    if not tls:
        return Reach(host, names, machine)
    hosts = {*LOOPBACK, *names, *machine}
    if host not in LOOPBACK:
        hosts |= {*machine_addresses(host)}
    return Reach(host, names, machine, own_certificate(folder or state_folder(), hosts, now))


def own_names(host: str) -> tuple[str, ...]:
    """This machine's names, under which a server bound to `host` answers; none on loopback."""
    return () if host in LOOPBACK else machine_names(socket.gethostname())


def machine_names(name: str) -> tuple[str, ...]:
    """Names under which others in the same network find the machine that calls itself `name`."""
    label = name.casefold().partition(".")[0]
    if not HOST_NAME.fullmatch(label) or label == "localhost":
        return ()
    return (f"{label}.local", label)


def checked_name(name: str) -> str:
    """A host name in lower case.

    Raises:
        SettingsError: If it is none; addresses need not be named.
    """
    lower = name.casefold().removesuffix(".")
    if not HOST_NAME.fullmatch(lower) or _is_address(lower):
        raise SettingsError(
            f"--name {name}: give a host name alone, such as avatar.example.org, without scheme "
            "and port; addresses of this machine need no --name."
        )
    return lower


def qr_code(text: str) -> list[str]:
    """A QR code in lines of half blocks, for a terminal with a dark background."""
    picture = io.StringIO()
    segno.make(text, error="l", micro=False).terminal(picture, border=QUIET_ZONE, compact=True)
    return picture.getvalue().rstrip("\n").split("\n")


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True
