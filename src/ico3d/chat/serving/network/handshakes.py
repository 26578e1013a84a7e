"""TLS handshakes that count: silent ones would hold a server's connections, and much memory.

uvicorn learns of a connection once its handshake is over, and waits a minute for that.
"""

import asyncio
import contextlib
import ssl
import types
from collections.abc import Coroutine, Generator
from typing import Any

from ico3d.chat.serving.crowd import peer_of
from ico3d.chat.serving.network import prompt
from ico3d.chat.serving.network.certificates import Certificate
from ico3d.chat.serving.network.records import CountedRecords

CURVE = "prime256v1"
"""The one group of keys, which all browsers have. Of OpenSSL's own choice, `ffdhe8192` takes 91 ms
of the loop for a hello that costs its sender nothing."""


class Handshake(asyncio.Protocol):
    """Makes the handshake of one connection, which `PromptProtocol` has from then on.

    Connections within their handshake count as those of `PromptProtocol` do, and have as long as
    the head of a request has.
    """

    context: ssl.SSLContext

    def __init__(self, **served: Any):
        """Takes what uvicorn gives to a connection."""
        self._served = served
        self._machine, self._counted = "", False
        self._early: list[bytes] = []  # came before the connection was handed over
        self._task: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begins the handshake, unless the machine has too many connections."""
        client = transport.get_extra_info("peername")
        self._machine = peer_of(client, self._served["config"].loaded_app)
        self._counted = True
        may = prompt.may_arrive(self._machine)
        if not (prompt.count_in(self._machine) and may):
            transport.abort()
            return
        loop = asyncio.get_running_loop()
        begun = loop.start_tls(
            transport, self, self.context, server_side=True, ssl_handshake_timeout=prompt.HEAD
        )
        secured = _under_way(begun)
        deciphers: Any = transport.get_protocol()
        transport.set_protocol(CountedRecords(transport, deciphers, self._machine))
        self._task = loop.create_task(self._hand_over(transport, secured))

    def data_received(self, data: bytes) -> None:
        """Keeps what comes between the handshake's end and its notice."""
        self._early.append(data)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the connection."""
        del exc
        self._uncount()

    async def _hand_over(
        self, transport: asyncio.Transport, secured: Coroutine[Any, Any, asyncio.Transport | None]
    ) -> None:
        """Hands the connection over once it is secure; closes it if it does not become so."""
        line = None
        with contextlib.suppress(OSError):  # of a client that gives up, or speaks no TLS
            line = await secured
        self._uncount()
        self._task = None  # which refers to this connection: many are begun and left
        if line is None or line.is_closing():
            transport.abort()
            return
        inner = prompt.PromptProtocol(**self._served)
        inner.below = transport
        line.set_protocol(inner)
        inner.connection_made(line)
        for data in self._early:
            inner.data_received(data)

    def _uncount(self) -> None:
        if self._counted:
            self._counted = False
            prompt.count_out(self._machine)


def _under_way(coroutine: Any) -> Any:
    """A coroutine whose first step, up to what it waits for, has been made.

    What a client sends at once reaches the handshake, and nobody else.
    """
    steps = coroutine.__await__()
    first = next(steps)

    @types.coroutine
    def rest() -> Generator[Any, None, Any]:
        yield first
        return (yield from steps)

    return rest()


def behind_tls(certificate: Certificate) -> type[Handshake]:
    """The protocol of connections that begin with a handshake for this certificate."""
    secure = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    secure.options |= ssl.OP_NO_RENEGOTIATION  # costs the server more than the client
    secure.set_ecdh_curve(CURVE)
    secure.load_cert_chain(certificate.file, certificate.key)

    class Secured(Handshake):
        """Handshakes for this certificate."""

        context = secure

    return Secured
