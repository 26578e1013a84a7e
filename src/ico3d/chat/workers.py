"""Threads that all sessions of a server share: who needs a result soonest is served first."""

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
    """Does work besides the event loop; `due` says when its result is needed."""

    async def __call__(self, due: float, work: Callable[..., Result], *args: Any) -> Result:
        """What the work returns."""
        ...


async def at_once(due: float, work: Callable[..., Result], *args: Any) -> Result:
    """Runs work that only waits, for another machine: nobody has to wait for a thread."""
    return await asyncio.to_thread(work, *args)


class Workers:
    """Runs work in threads, by the time at which it is due.

    Twenty faces are made faster than they are watched, but not if each answer is made to its end
    as soon as it is known: the next sentence of one would come too late for the end of another.
    """

    def __init__(self, threads: int | None = None):
        """Nothing to do yet.

        Args:
            threads: How many; by default one less than there are cores, at least one.
        """
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        self._free = threads or max(1, min(MOST, (cores or 1) - 1))
        self._waiting: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()

    async def run(self, due: float, work: Callable[..., Result], *args: Any) -> Result:
        """Waits for a thread, and for the work.

        Args:
            due: When the result is needed, seconds of one clock for all.
            work: What to do.
            *args: What it takes.
        """
        async with self.turn(due):
            return await asyncio.to_thread(work, *args)

    @asynccontextmanager
    async def turn(self, due: float) -> AsyncIterator[None]:
        """Waits until something that is due then may run; within, a thread is free for it."""
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
