"""Whether a client still waits for its answer, of which routes are not told."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from starlette.requests import Request

from ico3d.recording.refusals import Refused

CLIENT_GONE = 499
"""Status of an answer that nobody waits for any more."""
T = TypeVar("T")


async def while_there(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """What work comes to, for as long as the client of a request waits for it.

    Args:
        request: Whose body is of no interest.
        work: Is cancelled once the client has left.

    Raises:
        Refused: If the client left first.
    """

    async def leaves() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    working, leaving = asyncio.create_task(work), asyncio.create_task(leaves())
    try:
        await asyncio.wait((working, leaving), return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise Refused("left", "nobody waits for this any more.", CLIENT_GONE)
        return await working
    finally:
        working.cancel()
        leaving.cancel()
