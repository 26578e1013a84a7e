"""Whether an avatar at a URL is as visitors need it."""

import asyncio
import re
import socket
import ssl
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlsplit

import httpx

from ico3d.chat.doctor import visit
from ico3d.chat.doctor.fetching import PATIENCE, Client, fetch
from ico3d.chat.doctor.finding import Finding, bad, good, weak
from ico3d.chat.serving.guard import LOOPBACK
from ico3d.errors import SettingsError

LOGS = "look at the log of proxy and server."
TOKEN = re.compile(r"[!-~]{1,1000}")
RENEWED = 14  # days before its end by which a certificate should have been renewed


@dataclass(frozen=True)
class Place:
    """Where an avatar is.

    Attributes:
        scheme: `http` or `https`.
        host: Name or address.
        port: Port, or None for the scheme's own.
    """

    scheme: str
    host: str
    port: int | None

    @classmethod
    def of(cls, url: str) -> "Place":
        """The place that a URL names.

        Raises:
            SettingsError: If it is no URL of a page.
        """
        given = SettingsError(f"{url}: give an address such as https://avatar.example.org.")
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError as error:
            raise given from error
        if not host or parts.scheme not in ("http", "https"):
            raise given
        if parts.path.strip("/") or parts.query:
            raise SettingsError(f"{url}: an avatar is at the root of its address; leave the path.")
        return cls(parts.scheme, host, port)

    @property
    def url(self) -> str:
        """The address, without a slash at its end."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}" + (f":{self.port}" if self.port else "")


def findings(url: str, key: str = "") -> Iterator[Finding]:
    """Looks at a deployment from outside, as a visitor's browser would, and visits it.

    Args:
        url: Its address.
        key: The key that visitors have to show; empty for none.

    Raises:
        SettingsError: If the URL is none.
    """
    place = Place.of(url)
    context = ssl.create_default_context()
    reached = of_way(place)
    yield reached
    if reached.grade == "bad":
        return
    proven = place.host in LOOPBACK  # that nobody else answers
    if place.scheme == "https":
        found = of_certificate(place, context)
        yield found
        if found.grade == "bad":  # the rest can be looked at all the same
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        else:
            proven = True
    if key and not proven:
        yield unsent(place)
        key = ""
    try:
        yield from of_site(Client(place.url, context), place, context, key)
    except httpx.HTTPError as error:
        yield bad(f"an answer broke off ({type(error).__name__})", LOGS)


def of_site(client: Client, place: Place, context: ssl.SSLContext, key: str) -> Iterator[Finding]:
    """Looks at what is served, and visits it.

    Raises:
        HTTPError: If an answer breaks off.
    """
    answering = of_server(client, place)
    yield answering
    if answering.grade == "bad":
        return
    yield from of_page(client)
    if place.scheme == "https" and place.port in (None, 443):
        yield of_plain(place)
    token = token_for(client, key) if key else None
    bundle = of_bundle(client, token)
    yield bundle
    if bundle.grade != "good":
        return
    secured = context if place.scheme == "https" else None
    visitor = visit.Visitor(place.url, secured, client.cookies_for("/ws"), token)
    yield from asyncio.run(visitor.findings())


def unsent(place: Place) -> Finding:
    """Why the key stays here."""
    if place.scheme == "http":
        return weak("the key was not sent: everybody on the way could read it", "use HTTPS.")
    return weak(
        "the key was not sent: whoever answers may be somebody else",
        "mend the certificate first.",
    )


def of_way(place: Place) -> Finding:
    """Whether the host has an address and answers there, and whether microphones work."""
    port = place.port or {"http": 80, "https": 443}[place.scheme]
    try:
        socket.create_connection((place.host, port), PATIENCE).close()
    except socket.gaierror:
        return bad(f"{place.host} has no address", "add it to the domain's name server.")
    except OSError as error:
        return bad(
            f"{place.host} does not answer on port {port} ({error.strerror or error})",
            "start the server, or open the port in the firewall.",
        )
    if place.scheme == "http" and place.host not in LOOPBACK:
        return weak(
            f"{place.url} answers, without HTTPS",
            "browsers give no microphone to it; put a proxy with a certificate before it, or serve "
            "with --tls.",
        )
    return good(f"{place.url} answers")


def of_certificate(place: Place, context: ssl.SSLContext) -> Finding:
    """Whether browsers believe the certificate, and for how long."""
    try:
        until = asyncio.run(_certificate(place, context)).get("notAfter")
    except ssl.SSLCertVerificationError as error:
        return bad(
            f"browsers warn of the certificate ({error.verify_message})",
            "let the proxy get one from a public authority, or trust this one (SSL_CERT_FILE names "
            "further ones here).",
        )
    except OSError as error:
        why = str(error) or f"not within {PATIENCE:g} s"
        return bad(f"no TLS connection ({why})", "look at the proxy's log.")
    days = (ssl.cert_time_to_seconds(str(until)) - time.time()) / 86400
    if days < RENEWED and place.host not in LOOPBACK:
        return weak(f"the certificate ends in {days:.0f} days", "see why nothing renews it.")
    return good(f"the certificate is valid for {days:.0f} days")


async def _certificate(place: Place, context: ssl.SSLContext) -> dict[str, Any]:
    """What the certificate says.

    Raises:
        OSError: If there is no TLS connection, or not in time.
    """
    async with asyncio.timeout(PATIENCE):
        port = place.port or 443
        _, writer = await asyncio.open_connection(place.host, port, ssl=context)
    writer.transport.abort()
    return writer.get_extra_info("peercert") or {}


def of_server(client: Client, place: Place) -> Finding:
    """Whether the server is up, and takes visitors under this name."""
    try:
        answer = fetch(client, "/ready")
    except httpx.HTTPError as error:
        return bad(f"no answer ({type(error).__name__})", LOGS)
    if answer.status == 403:
        return bad(
            "the server does not know this name",
            f"serve with --name {place.host}, and let the proxy leave Host as it is.",
        )
    if answer.status == 503 and answer.headers.get("content-type") == "application/json":
        return bad("the server is about to end", "wait until it has started again.")
    if answer.status != 200:
        return bad(
            f"the server is not ready (status {answer.status})",
            "start it, and give the proxy its address.",
        )
    return good("the server is ready for visitors")


def of_page(client: Client) -> Iterator[Finding]:
    """Whether the page comes whole, protected and compressed, and figures do not."""
    page = fetch(client, "/")
    if page.status != 200:
        yield bad(f"the page does not come (status {page.status})", page.text.strip()[:200] or LOGS)
    elif "content-security-policy" not in page.headers:
        yield bad("headers that protect the page are lost", "let the proxy pass them on.")
    elif "content-encoding" not in page.headers:
        yield weak("the page is not compressed", "let the proxy pass Accept-Encoding on.")
    else:
        yield good("the page comes compressed, with the headers that protect it")
    if fetch(client, "/metrics").status == 200:
        yield bad("figures are public at /metrics", "let the proxy pass only the page's port on.")
    else:
        yield good("figures are not public")


def token_for(client: Client, key: str) -> str | None:
    """What admits a page, for a key; None if it is wrong."""
    headers = {"Authorization": f"Bearer {key}", "Accept-Encoding": "identity"}
    answer = fetch(client, "/token", "POST", headers=headers)
    token = answer.table.get("token")
    usable = isinstance(token, str) and TOKEN.fullmatch(token)
    return token if answer.status == 200 and usable else None


def of_bundle(client: Client, token: str | None) -> Finding:
    """Whether the bundle is served to those who are admitted."""
    parameters = {"token": token} if token else {}
    manifest = fetch(client, "/bundle/manifest.json", params=parameters)
    if manifest.status == 200:
        return good("the bundle is served")
    if manifest.status == 401:
        return weak(
            "visitors have to show a key, so this is as far as one gets without it",
            "name the environment variable that holds it with --key-variable.",
        )
    return bad(f"the bundle is not served (status {manifest.status})", "see the log.")


def of_plain(place: Place) -> Finding:
    """Whether who types the name alone is led to HTTPS."""
    try:
        answer = fetch(Client(replace(place, scheme="http", port=None).url), "/")
    except httpx.HTTPError:
        return weak("port 80 does not answer", "open it: who types the name alone begins there.")
    if answer.headers.get("location", "").startswith("https://"):
        return good("plain HTTP leads to HTTPS")
    return weak("plain HTTP does not lead to HTTPS", "let the proxy redirect it.")
