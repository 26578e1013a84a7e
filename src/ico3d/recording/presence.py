"""Whether a client still waits for its answer, of which routes are not told."""

import asyncio
import contextlib
import os
from collections.abc import Coroutine
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import FileResponse
from starlette.types import Receive, Scope, Send

from ico3d.recording.refusals import Refused

CLIENT_GONE = 499
"""Status of an answer that nobody waits for any more."""
UNASKED = 4096
"""Bytes that a client may send of a body that nobody reads."""
T = TypeVar("T")
EVERY = 1.0
"""Seconds between two looks whether a file that somebody is being sent is still there."""


async def while_there(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """What work comes to, for as long as the client of a request waits for it.

    Args:
        request: Whose body is of no interest, or was read.
        work: Is cancelled once the client has left, or sends more than `UNASKED` bytes.

    Raises:
        Refused: If the client did so first.
    """

    async def leaves() -> Refused:
        sent = 0
        while (message := await request.receive())["type"] != "http.disconnect":
            sent += len(message.get("body", b""))
            if sent > UNASKED:
                return Refused("large", "this is more than is taken at once.", 413)
        return Refused("left", "nobody waits for this any more.", CLIENT_GONE)

    working, leaving = asyncio.create_task(work), asyncio.create_task(leaves())
    try:
        await asyncio.wait((working, leaving), return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise await leaving
        return await working
    finally:
        working.cancel()
        leaving.cancel()


class Playing(FileResponse):
    """Sends a file for as long as it is there.

    What was removed would else stay on the disk, and be sent on, until a client has read it all.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends it, or breaks off."""
        sending = asyncio.create_task(super().__call__(scope, receive, send))
        try:
            while not sending.done() and self._is_there():
                await asyncio.wait({sending}, timeout=EVERY)
            if sending.done():
                with contextlib.suppress(FileNotFoundError):  # removed before it was opened
                    await sending
        finally:
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.wait({sending})

    def _is_there(self) -> bool:
        """Whether the file is still the one whose facts were told."""
        try:
            return self.stat_result is None or os.path.samestat(
                os.stat(self.path), self.stat_result
            )
        except OSError:
            return False
