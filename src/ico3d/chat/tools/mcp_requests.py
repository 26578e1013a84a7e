"""Leaves out what an MCP server asks of its client. Imported only where mcp is."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import anyio
from mcp.client import Transport
from mcp.shared.message import SessionMessage
from mcp_types import JSONRPCRequest

PING = "ping"


@asynccontextmanager
async def asked_nothing(transport: Transport) -> AsyncIterator[tuple[Any, Any]]:
    """A connection by which nothing is asked of the client but whether it is there.

    This client offers servers nothing that they could ask for: neither samples nor roots nor
    questions to a user. The SDK would compare a request with all kinds of them before it says no,
    and keep its complaints, tens of megabytes of 12 kB, until that is sent.
    """
    async with transport as (reading, writing):
        yield _Answers(reading), writing


class _Answers:
    """A stream of messages, without the requests among them."""

    def __init__(self, stream: Any):
        self._stream = stream

    @property
    def last_context(self) -> Any:
        """What the SDK notes of the sender of the last message."""
        return getattr(self._stream, "last_context", None)

    async def receive(self) -> SessionMessage | Exception:
        """The next message.

        Raises:
            anyio.EndOfStream: If there is none.
        """
        while _asks(message := await self._stream.receive()):
            pass
        return message

    async def aclose(self) -> None:
        """Closes the stream."""
        await self._stream.aclose()

    def __aiter__(self) -> "_Answers":
        return self

    async def __anext__(self) -> SessionMessage | Exception:
        try:
            return await self.receive()
        except anyio.EndOfStream as end:
            raise StopAsyncIteration from end

    async def __aenter__(self) -> "_Answers":
        await self._stream.__aenter__()
        return self

    async def __aexit__(self, *error: Any) -> bool | None:
        return await self._stream.__aexit__(*error)


def _asks(message: SessionMessage | Exception) -> bool:
    if isinstance(message, Exception) or not isinstance(message.message, JSONRPCRequest):
        return False
    return message.message.method != PING
