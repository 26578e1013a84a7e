"""Looks up names of hosts, so that one whose name server is silent holds up nothing else.

Event loops look names up in a few threads for all of the process, to the end even where nobody
waits any more, and wait for them as they close. A name server that does not answer takes ten
seconds of such a thread for each question.
"""

import asyncio
import contextlib
import ipaddress
import socket
import threading
from typing import Any

KEPT, FAILED = 10.0, 5.0
"""Seconds for which an answer is kept, and that there was none."""
MOST = 16
"""Names that are looked up at once."""


class Lookups:
    """The look-ups of an event loop: threads of their own, each for all who ask meanwhile."""

    def __init__(self, loop: asyncio.AbstractEventLoop):
        """Answers in this loop."""
        self._loop = loop
        self._asked: dict[tuple[Any, ...], asyncio.Future[list[Any]]] = {}

    async def find(self, *question: Any) -> list[Any]:
        """What `socket.getaddrinfo` answers to these arguments.

        Raises:
            OSError: If it fails, or too many others are under way.
        """
        answer = self._asked.get(question) or self._begun(question)
        return await asyncio.shield(answer)  # others wait for it, too

    def _begun(self, question: tuple[Any, ...]) -> "asyncio.Future[list[Any]]":
        if sum(not answer.done() for answer in self._asked.values()) >= MOST:
            raise socket.gaierror(socket.EAI_AGAIN, "too many names are looked up just now")
        answer = self._loop.create_future()
        threading.Thread(target=self._look_up, args=(question, answer), daemon=True).start()
        self._asked[question] = answer
        return answer

    def _look_up(self, question: tuple[Any, ...], answer: "asyncio.Future[list[Any]]") -> None:
        found, fault = None, None
        try:
            found = socket.getaddrinfo(*question)
        except Exception as error:
            fault = error
        with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
            self._loop.call_soon_threadsafe(self._answer, question, answer, found, fault)

    def _answer(
        self,
        question: tuple[Any, ...],
        answer: "asyncio.Future[list[Any]]",
        found: list[Any] | None,
        fault: Exception | None,
    ) -> None:
        if fault is None:
            answer.set_result(found or [])
        else:
            answer.set_exception(fault)
        self._loop.call_later(FAILED if fault else KEPT, self._asked.pop, question, None)


class _LookingUp(asyncio.AbstractEventLoop):
    """What an event loop does about names, whichever loop it is."""

    _lookups: Lookups | None = None

    async def getaddrinfo(
        self,
        host: Any,
        port: Any,
        *,
        family: int = 0,
        type: int = 0,
        proto: int = 0,
        flags: int = 0,
    ) -> Any:
        """As of any loop; names are looked up by `Lookups`."""
        host = host.decode("ascii") if isinstance(host, bytes) else host  # as anyio gives them
        if not _is_name(host):
            how = {"family": family, "type": type, "proto": proto, "flags": flags}
            return await super().getaddrinfo(host, port, **how)
        self._lookups = self._lookups or Lookups(self)
        return await self._lookups.find(host, port, family, type, proto, flags)

    async def create_connection(
        self, protocol_factory: Any, host: Any = None, port: Any = None, **how: Any
    ) -> Any:
        """As of any loop, to one address of a host after another."""
        if not _is_name(host):
            return await super().create_connection(protocol_factory, host, port, **how)
        if how.get("ssl") and how.get("server_hostname") is None:
            how["server_hostname"] = host
        kind = {name: how.get(name, 0) for name in ("family", "proto", "flags")}
        places = await self.getaddrinfo(host, port, type=socket.SOCK_STREAM, **kind)
        fault: OSError = socket.gaierror(socket.EAI_NONAME, "the host has no address")
        for *_, place in places:
            try:
                return await super().create_connection(protocol_factory, *place[:2], **how)
            except OSError as error:
                fault = error
        raise fault


def new_loop() -> asyncio.AbstractEventLoop:
    """An event loop, the fastest that is installed, whose names are looked up by `Lookups`."""
    try:
        from uvloop import Loop

        return type("LookingUp", (_LookingUp, Loop), {})()
    except ImportError:
        return type("LookingUp", (_LookingUp, asyncio.SelectorEventLoop), {})()


def _is_name(host: Any) -> bool:
    """Whether a host is to be looked up: an address, or none, is not."""
    if not isinstance(host, str) or not host:
        return False
    try:
        ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return True
    return False
