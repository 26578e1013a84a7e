"""Tells systemd that a server lives (sd_notify(3)): one that stands still is started anew."""

import asyncio
import contextlib
import os
import socket
from collections.abc import AsyncGenerator

PLACE, PATIENCE = "NOTIFY_SOCKET", "WATCHDOG_USEC"
"""Environment variables in which systemd says whom to tell, and within how many microseconds."""


@contextlib.asynccontextmanager
async def told_alive() -> AsyncGenerator[None]:
    """Says that the server is ready, and from then on that its event loop turns, where asked to."""
    if not os.environ.get(PLACE):
        yield
        return
    tell("READY=1")
    telling = asyncio.create_task(_go_on(os.environ.get(PATIENCE, "")))
    try:
        yield
    finally:
        telling.cancel()
        tell("STOPPING=1")


def tell(words: str) -> None:
    """Tells systemd something; nobody hears it where it has gone."""
    place = os.environ[PLACE]
    if place.startswith("@"):  # a name that is no file
        place = "\0" + place[1:]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line, contextlib.suppress(OSError):
        line.setblocking(False)
        line.sendto(words.encode(), place)


async def _go_on(microseconds: str) -> None:
    if not microseconds.isdecimal():
        return
    while True:
        tell("WATCHDOG=1")
        await asyncio.sleep(int(microseconds) / 2e6)
