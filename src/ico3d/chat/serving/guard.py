"""Protects a local server from other web pages, and limits what the server's page may load.

Any page in a browser can send requests to local ports, but it cannot forge the headers Origin and
Host. If an attacker lets a name point to this machine, that name appears in Host.
"""

import ipaddress
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
CONTENT_POLICY = "; ".join(
    [
        "default-src 'self'",
        "script-src 'self' 'wasm-unsafe-eval'",  # Spark sorts in WebAssembly
        "worker-src 'self' blob:",
        "connect-src 'self' data: blob:",
        "img-src 'self' data: blob:",
        "style-src 'self' 'unsafe-inline'",
        "media-src 'self' blob:",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)
HEADERS = {
    "Content-Security-Policy": CONTENT_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "microphone=(self), camera=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Guard:
    """ASGI middleware: 403 for a foreign Origin or Host, security headers on every response."""

    def __init__(self, app: ASGIApp, host: str, names: Collection[str] = ()):
        """Wraps `app`, which is bound to the address `host` and has further host names."""
        self._app = app
        self._host = host
        self._names = frozenset(names)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles or refuses one request or WebSocket handshake."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if not is_own(headers.get("host"), headers.get("origin"), self._host, self._names):
            await self._refuse(scope, receive, send)
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self._app(scope, receive, with_headers)

    async def _refuse(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})  # before accepting: HTTP 403
            return
        text = "This server answers only its own pages: open it under the address it printed.\n"
        await PlainTextResponse(text, 403)(scope, receive, send)


def is_own(host: str | None, origin: str | None, bound: str, names: Collection[str] = ()) -> bool:
    """Whether Host names this server and Origin is this server's page or missing.

    Args:
        host: The Host header.
        origin: The Origin header; programs other than browsers send none.
        bound: The address to which the server is bound.
        names: Further names of the server, in lower case.
    """
    name, port = split_host(host)
    if name is None or not (name in names or is_own_name(name, bound)):
        return False
    if origin is None:
        return True
    if not origin.startswith(("http://", "https://")):
        return False
    origin_name, origin_port = split_host(urlsplit(origin).netloc)
    same_name = origin_name == name or {origin_name, name} <= LOOPBACK
    return same_name and origin_port == port


def is_own_name(name: str, bound: str) -> bool:
    """Whether a name is loopback, the bound address or, on a public address, numeric.

    Numeric addresses cannot be the result of a DNS trick.
    """
    if name in LOOPBACK or name == bound.casefold():
        return True
    return bound not in LOOPBACK and _is_number(name)


def split_host(value: str | None) -> tuple[str | None, int | None]:
    """Name and port of `name:port`; (None, None) for a malformed value."""
    try:
        parts = urlsplit(f"//{value}")
        if not value or parts.username is not None or parts.path or parts.query or parts.fragment:
            return None, None
        return parts.hostname, parts.port
    except ValueError:
        return None, None


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
