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

from ico3d.chat.serving.guard import LOOPBACK, is_number
from ico3d.chat.serving.network.addresses import machine_addresses
from ico3d.chat.serving.network.certificates import (
    Certificate,
    given_certificate,
    own_certificate,
    state_folder,
)
from ico3d.errors import SettingsError

HOST_NAME = re.compile(r"(?!-)[a-z0-9-]{1,63}(?<!-)(\.(?!-)[a-z0-9-]{1,63}(?<!-))*")
ADMITTED = "who has the key gets in"
QUIET_ZONE = 2  # modules around a QR code


@dataclass(frozen=True)
class Reach:
    """Where a server can be reached.

    Attributes:
        host: Address to which it is bound.
        names: Host names that the operator gave, in lower case.
        own_names: Names of the machine itself, in lower case; empty on loopback.
        certificate: Certificate for HTTPS; None for HTTP.
        proxies: Addresses and networks of proxies that tell where visitors come from.
    """

    host: str
    names: tuple[str, ...] = ()
    own_names: tuple[str, ...] = ()
    certificate: Certificate | None = None
    proxies: tuple[str, ...] = ()

    @property
    def is_public(self) -> bool:
        """Whether others than users of this machine can come."""
        return self.host not in LOOPBACK or bool(self.names)

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

    def told(self, port: int, key: str | None = None) -> list[str]:
        """Sentences for the operator: who can reach the server, and what they have to know.

        Args:
            port: Port of the server.
            key: The key that admits, to be shown; empty for one that the operator has; None if
                everybody is admitted.
        """
        lines = self._audience(port, key)
        if self.is_public and not self.proxies and self.host in LOOPBACK:
            lines.append(
                "All of them seem to come from this machine, so limits per address do not hold: "
                "--proxy 127.0.0.1 believes what a proxy here says of where they come from."
            )
        if self.certificate is not None and self.certificate.slow:
            lines.append(
                "The certificate's key is so long that each handshake holds up everybody for tens "
                "of milliseconds: a key on the curve P-256, or of RSA with 2048 bits, does not."
            )
        if self.certificate is not None and self.certificate.own:
            lines += [
                "This machine has made the certificate itself, so each browser asks once whether "
                "to go on: choose »Advanced« or »Show details«, then »Proceed« or »Visit this "
                "website«. To be sure that it is this server, compare the SHA-256 fingerprint:",
                f"  {self.certificate.fingerprint}",
            ]
        return lines

    def _audience(self, port: int, key: str | None) -> list[str]:
        """Who can reach the server, and at which addresses."""
        admitted = "everybody can talk: no key is asked for" if key is None else ADMITTED
        if not self.is_public:
            open_it = "--host 0.0.0.0 --tls opens it for a phone beside it."
            keyed = "" if key is None else f"; {ADMITTED}"
            return [f"Only this machine reaches it{keyed}; {open_it}"]
        if self.host in LOOPBACK:
            names = " or ".join(self.names)
            through = f"whom a proxy or tunnel lets through as {names}; {admitted}."
            lines = [f"This machine reaches it, and so does everybody {through}"]
            return [*lines, f"  the key is {key}"] if key else lines
        urls = [url + fragment(key) for url in self.urls(port)]
        lines = [
            f"All devices in this machine's networks reach it; {admitted}. "
            "On other devices it is at",
            *(f"  {url}" for url in urls),
        ]
        if urls:
            lines += ["", *qr_code(urls[0]), ""]
        if self.certificate is None and not self.proxies:
            lines.append(
                "Browsers give their microphone only to HTTPS pages: without --tls, visitors on "
                "other devices can only type, and whoever listens in the network reads along."
            )
        return lines


def find_reach(
    host: str,
    names: Sequence[str],
    tls: bool,
    cert: Path | None,
    key: Path | None,
    proxies: Sequence[str] = (),
    is_open: bool = False,
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
        proxies: Addresses and networks of `--proxy`.
        is_open: Whether everybody is admitted, so that no key travels.
        folder: Where an own certificate is kept; by default the user's state folder.
        now: The time, with its zone; by default that of the machine.

    Raises:
        SettingsError: If a name is not a host name, a proxy no address or without a name to come
            by, a certificate cannot be used, or keys would travel unencrypted.
    """
    now = now or datetime.now(UTC)
    names = tuple(dict.fromkeys(map(checked_name, names)))
    proxies = tuple(map(checked_proxy, proxies))
    if host not in LOOPBACK and not (tls or cert or proxies or is_open):
        raise SettingsError(
            f"--host {host}: visitors have to show a key, which must not travel unencrypted. Add "
            "--tls, or --proxy ADDRESS if a proxy there encrypts, or --open to admit everybody."
        )
    machine = own_names(host)
    if (cert is None) != (key is None):
        raise SettingsError("--tls-cert and --tls-key belong together: give both or neither.")
    certificate = None
    if cert is not None and key is not None:
        certificate = given_certificate(cert, key, now)
        own = [name for name in certificate.names if HOST_NAME.fullmatch(name)]
        names = tuple(dict.fromkeys([*names, *(name for name in own if name not in LOOPBACK)]))
    if proxies and host in LOOPBACK and not names:
        raise SettingsError(
            f"--proxy {proxies[0]}: add --name with the host name under which visitors come to the "
            "proxy, or they would be taken for users of this machine."
        )
    if tls and certificate is None:
        hosts = {*LOOPBACK, *names, *machine}
        if host not in LOOPBACK:
            hosts |= {*machine_addresses(host)}
        certificate = own_certificate(folder or state_folder(), hosts, now)
    return Reach(host, names, machine, certificate, proxies)


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
    if not HOST_NAME.fullmatch(lower) or is_number(lower):
        raise SettingsError(
            f"--name {name}: give a host name alone, such as avatar.example.org, without scheme "
            "and port; addresses of this machine need no --name."
        )
    return lower


def checked_proxy(text: str) -> str:
    """An address or a network, as it was given.

    Raises:
        SettingsError: If it is neither, or everybody would be believed.
    """
    try:
        network = ipaddress.ip_network(text)
    except ValueError:
        raise SettingsError(
            f"--proxy {text}: give the proxy's address or network, such as 172.18.0.0/16."
        ) from None
    if network.prefixlen == 0:
        raise SettingsError(f"--proxy {text}: everybody could say to come from anywhere.")
    return text


def as_seen(proxies: Sequence[str]) -> list[str]:
    """Addresses and networks as connections show them: a socket of both families maps IPv4."""
    networks = [network for text in proxies if (network := ipaddress.ip_network(text)).version == 4]
    mapped = [f"::ffff:{one.network_address}/{96 + one.prefixlen}" for one in networks]
    return [*proxies, *mapped]


def fragment(key: str | None) -> str:
    """What follows a page's address, and never leaves the browser, to hold a key."""
    return f"#key={key}" if key else ""


def qr_code(text: str) -> list[str]:
    """A QR code in lines of half blocks, for a terminal with a dark background."""
    picture = io.StringIO()
    segno.make(text, error="l", micro=False).terminal(picture, border=QUIET_ZONE, compact=True)
    return picture.getvalue().rstrip("\n").split("\n")
