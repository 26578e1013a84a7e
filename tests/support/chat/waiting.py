"""Waiting for what happens soon on a quiet machine, and later on a busy one."""

import asyncio
from collections.abc import Callable

PATIENCE = 30.0
"""Seconds after which what has not happened never will."""


async def until(happened: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Waits until something has happened.

    Raises:
        TimeoutError: If it has not within some seconds.
    """
    async with asyncio.timeout(seconds):
        while not happened():
            await asyncio.sleep(0.01)
