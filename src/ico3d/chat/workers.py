"""Threads shared by all sessions of a server; the most urgent work runs first."""

import asyncio
import heapq
import itertools
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Protocol, TypeVar

Result = TypeVar("Result")

MOST = 4  # threads; more of them only take the interpreter from one another


class Run(Protocol):
    """Function that runs work outside of the event loop; `due` is when its result is needed."""

    async def __call__(self, due: float, work: Callable[..., Result], *args: Any) -> Result:
        """Returns the result of the work."""
        ...


async def at_once(due: float, work: Callable[..., Result], *args: Any) -> Result:
    """Runs work that only waits for another machine, without queueing for a thread."""
    return await asyncio.to_thread(work, *args)


class Workers:
    """Runs work in threads, in the order of due times.

    The server computes twenty faces faster than they are watched, but not if each answer is
    computed to its end at once: one visitor's next sentence would then be too late because of the
    end of another visitor's answer.
    """

    def __init__(self, threads: int | None = None):
        """Starts without work.

        Args:
            threads: Number of threads; by default one less than there are cores, at least one.
        """
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        self._free = threads or max(1, min(MOST, (cores or 1) - 1))
        self._waiting: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()

    async def run(self, due: float, work: Callable[..., Result], *args: Any) -> Result:
        """Waits for a thread and runs work in it; returns the result.

        Args:
            due: Time at which the result is needed, in seconds of one clock for all work.
            work: The function to call.
            *args: What it takes.
        """
        async with self.turn(due):
            return await asyncio.to_thread(work, *args)

    @asynccontextmanager
    async def turn(self, due: float) -> AsyncIterator[None]:
        """Waits until work with this due time may run; its thread is free in the `with` block."""
        await self._enter(due)
        try:
            yield
        finally:
            self._leave()

    async def _enter(self, due: float) -> None:
        if self._free:
            self._free -= 1
            return
        turn = asyncio.get_running_loop().create_future()
        heapq.heappush(self._waiting, (due, next(self._numbers), turn))
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled():
                self._leave()  # the turn came together with the end
            raise

    def _leave(self) -> None:
        while self._waiting:
            _, _, turn = heapq.heappop(self._waiting)
            if not turn.done():
                turn.set_result(None)
                return
        self._free += 1
