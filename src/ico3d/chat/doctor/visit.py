"""A short visit: whether WebSockets pass, strangers do not, and a dropped page finds back."""

import asyncio
import contextlib
import ssl
import statistics
import time
from collections.abc import AsyncIterator, Iterable

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, WebSocketException

from ico3d.chat.doctor.finding import Finding, bad, good, weak
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import Error, Hello, Place, ServerMessage, Welcome
from ico3d.errors import ProtocolError

PATIENCE = 30.0  # s for the start of a conversation
ROUNDS = 5  # messages by which the way is timed
DROPS = 4  # lost connections after which a proxy without a rule has most likely chosen wrongly
SLOW = 0.3  # s to and fro from which a conversation feels slow
FOREIGN = "https://foreign.example"
FAULTS = (OSError, WebSocketException, TimeoutError, ProtocolError)


class Straight(connect):
    """Opens a WebSocket where it was told to: no server sends this machine elsewhere."""

    def process_redirect(self, exc: Exception) -> Exception:
        """The error that a redirect is."""
        return exc


class Visitor:
    """Opens the WebSockets of a server as its own page would."""

    def __init__(
        self, url: str, context: ssl.SSLContext | None, cookies: str, token: str | None = None
    ):
        """Comes to a server.

        Args:
            url: Address of the page, without a slash at its end.
            context: How certificates are checked; None for plain HTTP.
            cookies: The header Cookie that the page would send, by which a proxy knows a visitor.
            token: What admits the page; None where everybody is admitted.
        """
        self._url, self._context = url, context
        self._admission = f"?token={token}" if token else ""
        self._headers = {"Cookie": cookies} if cookies else {}

    async def findings(self) -> Iterable[Finding]:
        """Everything that was found."""
        try:
            async with asyncio.timeout(PATIENCE):
                way = await self._way()
        except FAULTS as error:
            return [
                bad(
                    f"no WebSocket can be opened ({reason(error)})",
                    "let the proxy pass Upgrade, Host and Origin on.",
                )
            ]
        return [way, await self._strangers(), *await self._talk()]

    def _connect(self, path: str, origin: str) -> Straight:
        address = self._url.replace("http", "ws", 1) + path + self._admission
        return Straight(
            address,
            ssl=self._context,
            origin=origin,  # type: ignore[arg-type]
            additional_headers=self._headers,
            open_timeout=PATIENCE,
            max_size=protocol.MAX_BINARY_FRAME,
            proxy=None,
        )

    @contextlib.asynccontextmanager
    async def _open(self, path: str, origin: str) -> AsyncIterator[ClientConnection]:
        """A WebSocket, which is left without waiting for what else the server has to say."""
        wire = await self._connect(path, origin)
        try:
            yield wire
        finally:
            wire.transport.abort()

    async def _way(self) -> Finding:
        """How long a message takes there and back."""
        took = []
        async with self._open("/echo", self._url) as wire:
            for _ in range(ROUNDS):
                began = time.monotonic()
                await wire.send("x")
                await wire.recv()
                took.append(time.monotonic() - began)
        told = f"a message takes {1000 * statistics.median(took):.0f} ms there and back"
        if statistics.median(took) > SLOW:
            return weak(told, "serve from a place that is nearer to the visitors.")
        return good(told)

    async def _strangers(self) -> Finding:
        """Whether pages of other sites are kept out."""
        try:
            async with self._open("/ws", FOREIGN):
                return bad(
                    "pages of other sites may talk with it",
                    "let the proxy leave the header Origin as it is.",
                )
        except InvalidHandshake:
            return good("pages of other sites are refused")
        except FAULTS as error:
            return weak(
                f"pages of other sites get no answer ({reason(error)})", "see the proxy's log."
            )

    async def _talk(self) -> list[Finding]:
        """Begins a conversation, loses its connection, and comes back."""
        try:
            first, wire = await self._greeted(None)
        except FAULTS as error:
            return [bad(f"no conversation begins ({reason(error)})", "see the server's log.")]
        if isinstance(first, Place):
            await wire.close()
            return [good(f"all places are taken; the queue has {first.position - 1} before us")]
        if not isinstance(first, Welcome):
            await wire.close()
            said = first.message if isinstance(first, Error) else type(first).__name__
            return [bad("no conversation begins", said)]
        return [good("a conversation begins"), await self._drops(first.session, wire)]

    async def _drops(self, session: str, wire: ClientConnection) -> Finding:
        """Whether the way back leads to the server that has the conversation."""
        for _ in range(DROPS):
            wire.transport.abort()
            try:
                first, wire = await self._greeted(session)
            except FAULTS as error:
                return bad(
                    f"a page that loses its connection does not come back ({reason(error)})",
                    "see the server's log.",
                )
            if not isinstance(first, Welcome) or not first.resumed:
                await wire.close()
                return bad(
                    "a page that loses its connection reaches another server",
                    "let the proxy keep each visitor at one server (lb_policy cookie in Caddy).",
                )
        await wire.close()
        return good(f"a conversation goes on after a lost connection ({DROPS} of {DROPS})")

    async def _greeted(self, session: str | None) -> tuple[ServerMessage, ClientConnection]:
        """Opens a connection and says hello; the server's first message."""
        wire = await self._connect("/ws", self._url)
        try:
            async with asyncio.timeout(PATIENCE):
                await wire.send(encode(Hello(protocol.VERSION, session, -1)))
                return decode_server(await wire.recv()), wire
        except FAULTS:
            wire.transport.abort()
            raise


def reason(error: Exception) -> str:
    """What went wrong, in a few words."""
    return f"nothing came for {PATIENCE:g} s" if isinstance(error, TimeoutError) else str(error)
