"""Work that people ask for: a few pieces at a time, each person in turn.

Who asks for a hundred pieces keeps nobody else waiting for more than those that have begun, and the
next.
"""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")
R = TypeVar("R")


async def _nothing(found: T) -> T:
    """Leaves it at that."""
    return found


@dataclass(eq=False)
class _Piece:
    """Work that somebody waits for.

    Attributes:
        whose: Who asked for it.
        key: What it is.
        work: Does it.
        then: Follows it, with what it came to, and makes the result of that.
        result: What both came to; fails as they did.
        askers: How many wait for it.
    """

    whose: str
    key: Hashable
    work: Callable[[], Awaitable[Any]]
    then: Callable[[Any], Awaitable[Any]]
    result: asyncio.Future[Any] = field(default_factory=asyncio.Future[Any])
    askers: int = 0


class FairQueue:
    """Pieces of work, each done once however many ask for it meanwhile."""

    def __init__(self, places: int):
        """Takes how many pieces are done at a time."""
        self._free = places
        self._pieces: dict[Hashable, _Piece] = {}
        self._waiting: dict[str, deque[_Piece]] = {}
        """Pieces that have not begun, by person; whose turn is next comes first."""
        self._tasks: set[asyncio.Task[None]] = set()

    async def done(
        self,
        whose: str,
        key: Hashable,
        work: Callable[[], Awaitable[T]],
        then: Callable[[T], Awaitable[R]] = _nothing,
    ) -> R:
        """What a piece of work comes to, once it is done.

        If all who wait for it are cancelled before it has begun, it is not done; else it is done to
        its end, and so is what follows.

        Args:
            whose: Who asks for it.
            key: What it is: if it waits or is being done already, that is joined.
            work: Does it.
            then: Follows, without a place: it may wait long for something else.

        Raises:
            Exception: Whatever the work raises, or what follows.
        """
        piece = self._pieces.get(key) or self._add(_Piece(whose, key, work, then))
        piece.askers += 1
        self._begin_next()
        try:
            return await asyncio.shield(piece.result)
        finally:
            piece.askers -= 1
            if not piece.askers:
                self._drop(piece)

    def _add(self, piece: _Piece) -> _Piece:
        piece.result.add_done_callback(lambda it: it.cancelled() or it.exception())  # all left
        self._pieces[piece.key] = piece
        self._waiting.setdefault(piece.whose, deque()).append(piece)
        return piece

    def _drop(self, piece: _Piece) -> None:
        """Forgets a piece that has not begun."""
        line = self._waiting.get(piece.whose)
        if line and piece in line:
            del self._pieces[piece.key]
            line.remove(piece)
            if not line:
                del self._waiting[piece.whose]

    def _begin_next(self) -> None:
        """Begins as many pieces as there are places for."""
        while self._free and self._waiting:
            whose = next(iter(self._waiting))
            line = self._waiting.pop(whose)
            task = asyncio.create_task(self._do(line.popleft()))
            if line:
                self._waiting[whose] = line  # behind everybody else
            self._free -= 1
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _do(self, piece: _Piece) -> None:
        try:
            found = await self._in_its_place(piece)
            piece.result.set_result(await piece.then(found))
        except Exception as error:
            piece.result.set_exception(error)
        finally:
            piece.result.cancel()  # unless it is done
            del self._pieces[piece.key]

    async def _in_its_place(self, piece: _Piece) -> Any:
        """What its work comes to; others have its place afterwards."""
        try:
            return await piece.work()
        finally:
            self._free += 1
            self._begin_next()
