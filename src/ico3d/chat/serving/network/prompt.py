"""Connections whose requests arrive promptly, so that nobody holds many of them by being slow.

uvicorn waits for the head of a request for ever, queues all requests behind one whose answer is
not read, and opens as many connections as there are descriptors: some hundred silent ones would
close a server to everybody.
"""

import asyncio
import resource
import time
from collections import Counter
from typing import NoReturn
from weakref import WeakKeyDictionary

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from ico3d.chat.bucket import Bucket
from ico3d.chat.serving.crowd import Meters, peer_of
from ico3d.errors import ProtocolError

HEAD = 10.0  # s for the head of a request
LARGEST_HEAD = 1 << 16  # bytes
MOST_HEADERS = 200  # of a request, those behind its body included
PIECES, SMALL = 200, 512
"""Small pieces that a request's body may have at once, and bytes of others that allow one more:
each costs this process time, however small it is, and a chunk of one byte is a piece."""
LEFT_OVER = float(16 << 20)
"""Bytes in a second, of all connections, of bodies whose requests are answered. They would come as
fast as they can be thrown away; but some clients read an answer only behind all they have sent."""
MOST_OPEN = 128  # connections of one machine, WebSockets aside
RATE, AT_ONCE = 32.0, 256.0
"""New connections of one machine in a second, and at once: a browser opens six for a page, and
keeps them. Who leaves at once frees a place, while the request that was sent is worked on."""
DESCRIPTORS = 1 << 16  # that a server asks the system for
LONGEST_TARGET = 4096  # bytes of what a request asks for, its query included
UNREAD = (b"cookie", b"sec-websocket-protocol", b"sec-websocket-extensions")
"""Headers that ico3d has no use for, but libraries parse before every route: cookies, for which
older Python takes the square of a quoted value's length (CVE-2024-7592), and lists of WebSockets,
read word by word."""
PARSED = frozenset(
    b"accept accept-encoding accept-language connection content-length content-type expect host "
    b"if-modified-since if-none-match if-range origin range te trailer transfer-encoding upgrade "
    b"x-forwarded-for x-forwarded-proto".split()
)
"""Headers of which anybody reads more than whether they equal something."""
MOST_PARSED = 2048
"""Bytes of all of these in a request. Heads of many connections come in one turn of the loop, which
has time for each of them only if none costs more than a millisecond."""
_open: Counter[str] = Counter()
_arrivals = Meters(RATE, AT_ONCE, time.monotonic)
_left_over = WeakKeyDictionary[asyncio.AbstractEventLoop, Bucket]()


class PromptProtocol(HttpToolsProtocol):
    """HTTP on one connection, which is closed if a request's head takes too long or is too large.

    So it is if a body comes in crumbs, or goes on for `HEAD` seconds behind the answer.

    Behind a request that is not answered yet, one more may wait: a client may be that quick. One
    machine may have so many connections open and no more. Those of proxies that the operator
    has stated, and of this machine, are not counted.

    Attributes:
        below: What carries the connection's TLS; None without.
    """

    below: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Opens the connection, or closes it if its machine has too many, or too many new ones.

        One with TLS has arrived before its handshake.
        """
        super().connection_made(transport)
        self._machine = peer_of(self.client, self.app)
        self._counted = True
        self._head_bytes = 0  # since anything else came: of a head, or of headers behind a body
        self._deadline: asyncio.TimerHandle | None = None
        allowed = Bucket(LEFT_OVER, LEFT_OVER, _running_time)
        self._left_over = _left_over.setdefault(self.loop, allowed)
        self._pause: asyncio.TimerHandle | None = None  # of reading what comes behind an answer
        self._left = 0  # bytes of answers that had not been sent when that was last asked
        self._first: RequestResponseCycle | None = None  # that another one may wait for
        may = transport.get_extra_info("sslcontext") or may_arrive(self._machine)
        if count_in(self._machine) and may:
            self._await_head()
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the connection; a request with another one behind it is told, too."""
        self._stop_waiting()
        if self._pause is not None:
            self._pause.cancel()
        self._uncount()
        if self._first is not None:
            self._first.disconnected = True
            self._first.message_event.set()
        super().connection_lost(exc)
        for cycle, _ in self.pipeline:  # never begun: uvicorn would leave a circle of references
            cycle.on_response = _nothing
        self.pipeline.clear()

    def data_received(self, data: bytes) -> None:
        """Takes bytes, unless they make a head too large."""
        self._head_bytes += len(data)
        super().data_received(data)
        if self._head_bytes > LARGEST_HEAD:
            self.transport.abort()

    def on_message_begin(self) -> None:
        """A request begins, unless one waits already.

        Raises:
            ProtocolError: If one does; the connection is closed.
        """
        if self.pipeline:
            self._cut_off("one request at a time, and one more.")
        super().on_message_begin()
        self._num_headers = self._parsed = 0
        self._within_head = True

    def on_url(self, url: bytes) -> None:
        """A piece of what is asked for has arrived.

        Raises:
            ProtocolError: If it is too long; the connection is closed.
        """
        super().on_url(url)
        if len(self.url) > LONGEST_TARGET:
            self._cut_off(f"asks for more than {LONGEST_TARGET} bytes.")

    def on_header(self, name: bytes, value: bytes) -> None:
        """A header has arrived; some are left out, for WebSockets, too.

        So are headers behind a body: a proxy that is asked to vouch for an address or a key looks
        at the head alone, and passes on the others as they are.

        Raises:
            ProtocolError: If it is one too many, or there is too much to read in them; the
                connection is closed.
        """
        self._num_headers += 1
        if self._num_headers > MOST_HEADERS:
            self._cut_off(f"more than {MOST_HEADERS} headers.")
        lowered = name.lower()
        if lowered in PARSED:
            self._parsed += len(value)
            if self._parsed > MOST_PARSED:
                self._cut_off("headers with too much in them.")
        if self._within_head and lowered not in UNREAD:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """The head of a request has arrived."""
        self._within_head = False
        self._stop_waiting()
        self._head_bytes = 0
        self._pieces_left = float(PIECES)
        before = self.cycle
        super().on_headers_complete()
        self._first = before if self.pipeline else self.cycle

    def on_body(self, body: bytes) -> None:
        """A piece of a request's body has arrived, whether the request is answered or not.

        Raises:
            ProtocolError: If the body comes in too many small ones; the connection is closed.
        """
        self._head_bytes = 0
        if self.cycle is not None and self.cycle.response_complete:
            wait = self._left_over.owe(len(body))
            if wait and self._pause is None:
                self._pause_reading(wait)
        self._pieces_left = min(PIECES, self._pieces_left + len(body) / SMALL) - 1
        if self._pieces_left < 0:
            self._cut_off("a body in crumbs.")
        super().on_body(body)

    def on_message_complete(self) -> None:
        """A request has arrived as a whole."""
        self._head_bytes = 0
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """The next request may follow, and has to soon."""
        super().on_response_complete()
        if not self.transport.is_closing():
            self._left = 0
            self._await_head()

    def handle_websocket_upgrade(self) -> None:
        """Hands the connection over; WebSockets are counted elsewhere.

        Nobody would tell an answer that is still being written when its client has gone.
        """
        if self.cycle is not None and not self.cycle.response_complete:
            self.transport.abort()
            return
        self._uncount()
        super().handle_websocket_upgrade()

    def _pause_reading(self, seconds: float) -> None:
        self.flow.pause_reading()
        self._pause = self.loop.call_later(seconds, self._read_on)

    def _read_on(self) -> None:
        """Reads what comes behind an answer as soon as there is time for it."""
        self._pause = None
        if wait := self._left_over.owe(0):
            self._pause_reading(wait)
        elif self.cycle is None or self.cycle.response_complete:  # another request reads by itself
            self.flow.resume_reading()

    def _await_head(self) -> None:
        self._stop_waiting()
        self._deadline = self.loop.call_later(HEAD, self._give_up)

    def _stop_waiting(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _give_up(self) -> None:
        """Ends the connection, unless an earlier answer is still being read, however slowly."""
        self._deadline = None
        if self.cycle is not None and not self.cycle.response_complete:
            return  # a pipelined one is answered
        before, self._left = self._left, self._unsent()
        if self._left and (self._left < before or not before):
            self._await_head()
        else:
            self.transport.abort()

    def _unsent(self) -> int:
        """Bytes of answers that the system has not taken yet."""
        lines = (self.transport, self.below)
        return sum(line.get_write_buffer_size() for line in lines if line is not None)

    def _cut_off(self, why: str) -> NoReturn:
        """Closes the connection; the error has the parser leave the rest."""
        self.transport.abort()
        raise ProtocolError(why)

    def _uncount(self) -> None:
        if self._counted:
            self._counted = False
            count_out(self._machine)


def _nothing() -> None:
    """Takes the place of what would have been told of a request that is dropped."""


def _running_time() -> float:
    """Seconds of the loop that runs, which a bound method would keep alive."""
    return asyncio.get_running_loop().time()


def may_arrive(machine: str) -> bool:
    """Counts a new connection of a machine; returns whether it has not had too many lately."""
    return _arrivals.take(machine)


def count_in(machine: str) -> bool:
    """Counts a connection of a machine; returns whether it may have that many."""
    _open[machine] += 1
    return not machine or _open[machine] <= MOST_OPEN


def count_out(machine: str) -> None:
    """A connection that was counted is closed, or counted elsewhere."""
    _open[machine] -= 1
    if not _open[machine]:
        del _open[machine]


def allow_many_connections() -> None:
    """Has the system allow as many open connections as it lets this process have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
