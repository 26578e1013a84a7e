"""A WebSocket that returns what it gets, by which `/check` measures the way to the server."""

import asyncio
import contextlib

from fastapi import WebSocket, WebSocketDisconnect

MOST = 32  # messages of a connection
LONGEST = 64  # characters of a message
PATIENCE = 15.0  # s for all of them


async def echo(socket: WebSocket) -> None:
    """Returns short texts until either side has had enough."""
    await socket.accept()
    with contextlib.suppress(WebSocketDisconnect, KeyError, TimeoutError):  # bytes are no text
        async with asyncio.timeout(PATIENCE):
            for _ in range(MOST):
                text = await socket.receive_text()
                if len(text) > LONGEST:
                    break
                await socket.send_text(text)
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it has closed
        await socket.close()
