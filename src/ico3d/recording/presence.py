"""Whether a client still waits for its answer, of which routes are not told."""

import asyncio
from collections.abc import Coroutine
from typing import Any

from starlette.requests import Request

CLIENT_GONE = 499
"""Status of an answer that nobody waits for any more."""


async def while_there(request: Request, work: Coroutine[Any, Any, None]) -> bool:
    """Waits for work as long as the client of a request, whose body is of no interest, does.

    Returns:
        Whether the work was done.
    """

    async def leaves() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    working, leaving = asyncio.create_task(work), asyncio.create_task(leaves())
    try:
        await asyncio.wait((working, leaving), return_when=asyncio.FIRST_COMPLETED)
        if working.done():
            await working
        return working.done()
    finally:
        working.cancel()
        leaving.cancel()
