"""TLS certificates: one that this machine makes and renews itself, or one from files."""

import contextlib
import ipaddress
import os
import ssl
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from ico3d.errors import SettingsError

VALID = timedelta(days=397)  # browsers accept no public certificate for longer
RENEWED = timedelta(days=14)  # before its end
SKEW = timedelta(days=1)  # by which another machine's clock may be behind
NAME = "server.pem"


LONGEST_RSA = 4096
"""Bits of a key that signs within two milliseconds; one of twice as many takes over twenty."""


@dataclass(frozen=True)
class Certificate:
    """A certificate and where its key is.

    Attributes:
        file: PEM file of the certificate and its chain.
        key: PEM file of the private key; may be the same file.
        names: Host names for which it is valid, in lower case.
        own: Whether this machine has made it, so that browsers ask their users about it.
        fingerprint: SHA-256 hash of the certificate, in hexadecimal, as browsers show it.
        slow: Whether its key is so long that handshakes hold up everybody.
    """

    file: Path
    key: Path
    names: tuple[str, ...]
    own: bool
    fingerprint: str
    slow: bool


def state_folder() -> Path:
    """The folder in which certificates are kept between starts."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "ico3d" / "tls"


def own_certificate(folder: Path, hosts: Collection[str], now: datetime) -> Certificate:
    """The self-signed certificate of this machine, made or renewed if necessary.

    It is kept as long as it is valid for at least `RENEWED` and for all hosts, so that browsers ask
    only once. A certificate for further hosts remains valid for the hosts of before, between which
    a laptop may move.

    Args:
        folder: Where it is kept; created, accessible only to its owner.
        hosts: Names and addresses for which it has to be valid.
        now: The time, with its zone.

    Raises:
        SettingsError: If the folder cannot be written.
    """
    file = folder / NAME
    wanted = {host.casefold() for host in hosts}
    kept = _read_own(file)
    if kept is not None and kept.not_valid_before_utc <= now < kept.not_valid_after_utc - RENEWED:
        before = set(hosts_of(kept))
        if wanted <= before:
            return _described(kept, file, file, own=True)
        wanted |= before
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        made, text = _make(sorted(wanted), now)
        _write_secret(file, text)
    except OSError as error:
        raise SettingsError(
            f"--tls: the certificate cannot be kept in {folder} ({error.strerror}); "
            "XDG_STATE_HOME names another place."
        ) from error
    return _described(made, file, file, own=True)


def given_certificate(file: Path, key: Path, now: datetime) -> Certificate:
    """A certificate from files.

    Raises:
        SettingsError: If a file cannot be read, they do not belong together, the key is encrypted,
            or the certificate is not valid now.
    """
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(file, key, password="")  # or it would ask at the terminal
        certificate = x509.load_pem_x509_certificate(file.read_bytes())
    except ssl.SSLError as error:
        raise SettingsError(
            f"--tls-cert {file} and --tls-key {key} cannot be used together "
            f"({error.reason or error}): both must be PEM files, the key of this certificate and "
            "without a password."
        ) from error
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise SettingsError(
            f"--tls-cert {file}, --tls-key {key}: cannot be read ({why})."
        ) from error
    if not certificate.not_valid_before_utc <= now < certificate.not_valid_after_utc:
        span = [
            f"{t:%Y-%m-%d}"
            for t in (certificate.not_valid_before_utc, certificate.not_valid_after_utc)
        ]
        raise SettingsError(
            f"--tls-cert {file}: valid only from {span[0]} to {span[1]}; get a new one."
        )
    return _described(certificate, file, key, own=False)


def hosts_of(certificate: x509.Certificate) -> list[str]:
    """Names and addresses for which a certificate is valid, in lower case."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return []
    addresses = [str(address) for address in names.get_values_for_type(x509.IPAddress)]
    return [name.casefold() for name in names.get_values_for_type(x509.DNSName)] + addresses


def _described(certificate: x509.Certificate, file: Path, key: Path, own: bool) -> Certificate:
    names = tuple(host for host in hosts_of(certificate) if _address(host) is None)
    fingerprint = certificate.fingerprint(hashes.SHA256()).hex(":").upper()
    public = certificate.public_key()
    slow = isinstance(public, rsa.RSAPublicKey) and public.key_size > LONGEST_RSA
    return Certificate(file, key, names, own, fingerprint, slow)


def _read_own(file: Path) -> x509.Certificate | None:
    """The certificate of before; None if there is none that works, or others could read its key."""
    with contextlib.suppress(OSError, ValueError, ssl.SSLError):
        if os.name == "posix" and file.stat().st_mode & 0o077:
            return None
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(file, password="")
        return x509.load_pem_x509_certificate(file.read_bytes())
    return None


def _make(hosts: list[str], now: datetime) -> tuple[x509.Certificate, bytes]:
    """A new certificate, and the text of it and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "ico3d on this machine")])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now.astimezone(UTC) - SKEW)
        .not_valid_after(now.astimezone(UTC) - SKEW + VALID)
        .add_extension(x509.SubjectAlternativeName([_general(host) for host in hosts]), False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), False)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return certificate, secret + certificate.public_bytes(Encoding.PEM)


def _general(host: str) -> x509.GeneralName:
    address = _address(host)
    return x509.DNSName(host) if address is None else x509.IPAddress(address)


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def _write_secret(file: Path, text: bytes) -> None:
    """Writes a file that only its owner can read, all of it or nothing."""
    new = file.with_suffix(f".{os.getpid()}")
    with contextlib.suppress(FileNotFoundError):
        new.unlink()
    with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
        stream.write(text)
    new.replace(file)
