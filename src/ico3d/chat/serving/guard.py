"""Protects a server from other web pages, and limits what the server's page may load.

Any page in a browser can send requests to local ports, but it cannot forge the headers Origin and
Host. If an attacker lets a name point to this machine, that name appears in Host. Sites that may
embed the avatar are exceptions (`sites.py`).
"""

import contextlib
import ipaddress
from collections.abc import Callable, Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ico3d.chat.serving.crowd import GONE, MOST_REQUESTS, Crowd, machine_of
from ico3d.chat.serving.refusals import Refusals
from ico3d.chat.serving.sites import Sites

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
    ]
)
HEADERS = {
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "microphone=(self), camera=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
WITH_CAMERA = "microphone=(self), camera=(self), geolocation=()"
FOREIGN = "This server answers only its own pages: open it under the address it printed.\n"
NO_TOKEN = "The page's token is missing or has expired.\n"
TOO_MANY = "This machine has too many connections open, or requests that are not answered yet.\n"


class Guard:
    """ASGI middleware: 403 for a foreign Origin or Host, security headers on every response.

    Sites that may embed the avatar load what they need; a missing token is answered with 401. One
    machine may have so many WebSockets open, and requests worked on, and no more.
    """

    def __init__(
        self,
        app: ASGIApp,
        host: str,
        sites: Sites | None = None,
        names: Collection[str] = (),
        camera: bool = False,
        refusals: Refusals | None = None,
    ):
        """Wraps `app`, which is bound to the address `host`.

        Args:
            app: What is guarded.
            host: Address to which it is bound.
            sites: Sites that may embed the avatar; by default none.
            names: Further host names of the server.
            camera: Whether its pages may ask for the camera.
            refusals: Takes which sites were refused, where sites can be allowed.
        """
        self._headers = HEADERS | ({"Permissions-Policy": WITH_CAMERA} if camera else {})
        self._app = app
        self._host = host
        self._sites = sites or Sites()
        self._names = frozenset(names)
        self._crowd, self._requests = Crowd(), Crowd(MOST_REQUESTS)
        self._refusals = refusals

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles or refuses one request or WebSocket handshake."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        origin, path = headers.get("origin"), scope["path"]
        site = origin if self._sites.permits(origin, path) else None
        hosts = headers.getlist("host")
        host = hosts[0] if len(hosts) == 1 else None  # of two, others might look at the second
        if not is_own(host, None if site else origin, self._host, self._names):
            if self._refusals and origin and is_own(host, None, self._host, self._names):
                self._refusals.tell(origin, path)
            await self._refuse(403, FOREIGN, scope, receive, send)
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                policy = f"{CONTENT_POLICY}; frame-ancestors {self._sites.ancestors}"
                own = self._headers | {"Content-Security-Policy": policy}
                answer = MutableHeaders(scope=message)
                for name, value in (own | self._sites.headers(origin, path)).items():
                    if name == "Vary":
                        answer.add_vary_header(value)
                    else:
                        answer[name] = value
            await send(message)

        if not self._sites.admits(scope, site):
            await self._refuse(401, NO_TOKEN, scope, receive, with_headers)
            return
        if scope["type"] == "http":
            with self._requests.one_more(machine_of(scope.get("client"))) as may:
                if may:
                    await self._app(scope, receive, with_headers)
                else:
                    await self._refuse(429, TOO_MANY, scope, receive, with_headers)
            return
        with contextlib.ExitStack() as place:
            may = place.enter_context(self._crowd.one_more(machine_of(scope.get("client"))))
            if GONE in scope:
                scope[GONE].add_done_callback(_left(place.pop_all()))
            if may:
                await self._app(scope, receive, with_headers)
            else:
                await self._refuse(429, TOO_MANY, scope, receive, send)

    async def _refuse(
        self, status: int, sentence: str, scope: Scope, receive: Receive, send: Send
    ) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})  # before accepting: HTTP 403
            return
        await PlainTextResponse(sentence, status)(scope, receive, send)


def _left(place: contextlib.ExitStack) -> Callable[[object], None]:
    """What gives a place back once its connection is gone."""
    return lambda _: place.close()


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
    scheme, _, rest = origin.partition("://")
    if scheme not in ("http", "https"):
        return False
    origin_name, origin_port = split_host(rest)
    same_name = origin_name == name or {origin_name, name} <= LOOPBACK
    return same_name and origin_port == port


def is_own_name(name: str, bound: str) -> bool:
    """Whether a name is loopback, the bound address or, on a public address, numeric.

    Numeric addresses cannot be the result of a DNS trick.
    """
    if name in LOOPBACK or name == bound.casefold():
        return True
    return bound not in LOOPBACK and is_number(name)


def split_host(value: str | None) -> tuple[str | None, int | None]:
    """Name and port of `name:port`, without the dot that may end a name.

    Both are None for a malformed value.
    """
    try:
        parts = urlsplit(f"//{value}")
        if not value or parts.username is not None or parts.path or parts.query or parts.fragment:
            return None, None
        return (parts.hostname or "").removesuffix(".") or None, parts.port
    except ValueError:
        return None, None


def is_number(name: str) -> bool:
    """Whether a name is an IP address."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
