"""TLS records that count: each costs the process time, however few bytes it has.

A record of one byte is decrypted by a call of its own, before anybody learns how many there were,
and a client may ask for new keys or a new handshake in records that nothing above TLS ever sees.
"""

import asyncio
import time

from ico3d.chat.bucket import Bucket
from ico3d.chat.serving.crowd import Meters

HEAD = 5  # bytes: type, version, length
CHANGE_CIPHER, HANDSHAKE = 20, 22  # types, in the clear whatever the records hold
MOST_HANDSHAKE = 16  # records of a client's handshake: some clients cut their hello into pieces
LONGEST_HANDSHAKE = 8192
"""Bytes of a client's handshake: hellos of browsers have 2 kB, and may come twice. OpenSSL looks
for each key in one through all of its groups: 20 ms for 64 kB."""
LARGE = 4096  # bytes of a record that costs nothing; a smaller one costs what it lacks
RATE, AT_ONCE = 300.0, 2000.0
"""Empty records of a second, and at once: a page may send as many messages after a stall."""
MACHINE_RATE, MACHINE_AT_ONCE = 2000.0, 6000.0
"""The same of all connections of a machine, 21 µs each where they ask for new keys. Forty people
who speak send as many."""
STEADY, STEADY_AT_ONCE = 40.0, 64.0
"""Those of a connection that are not counted among its machine's: as many as somebody sends who
speaks. So nobody cuts off those who share an address."""
_machines = Meters(MACHINE_RATE, MACHINE_AT_ONCE, time.monotonic)


class CountedRecords(asyncio.Protocol):
    """Stands between a connection and its TLS, and closes it if its records are too many.

    A client of TLS 1.2 that has finished its handshake cannot begin another one.
    """

    def __init__(
        self, transport: asyncio.Transport, secured: asyncio.BufferedProtocol, machine: str
    ):
        """Takes the place of what deciphers.

        Args:
            transport: The connection.
            secured: What deciphers what comes, and has been connected to the transport.
            machine: What `machine_of` returned: all its connections count together.
        """
        self._transport, self._secured = transport, secured
        now = asyncio.get_running_loop().time
        self._own, self._steady = Bucket(RATE, AT_ONCE, now), Bucket(STEADY, STEADY_AT_ONCE, now)
        self._shared = _machines.of(machine)
        self._head = b""  # of a record whose head has come in part
        self._left = 0  # bytes of a record whose body has come in part
        self._handshakes, self._handshake_bytes, self._finished = 0, 0, False

    def data_received(self, data: bytes) -> None:
        """Hands on what has come, unless it holds too many records."""
        if self._transport.is_closing():
            return
        if not self._may_come(data):
            self._transport.abort()
            return
        rest = memoryview(data)
        while rest and not self._transport.is_closing():
            room = memoryview(self._secured.get_buffer(len(rest)))
            size = min(len(room), len(rest))
            room[:size] = rest[:size]
            self._secured.buffer_updated(size)
            rest = rest[size:]

    def eof_received(self) -> bool | None:
        """Tells that no more comes."""
        return self._secured.eof_received()

    def connection_lost(self, exc: Exception | None) -> None:
        """Tells that the connection has ended."""
        self._secured.connection_lost(exc)

    def pause_writing(self) -> None:
        """Tells that the connection takes no more for now."""
        self._secured.pause_writing()

    def resume_writing(self) -> None:
        """Tells that it does again."""
        self._secured.resume_writing()

    def _may_come(self, data: bytes) -> bool:
        """Counts the records that begin in the data."""
        at = self._left
        while at < len(data):
            head = self._head + data[at : at + HEAD - len(self._head)]
            at += len(head) - len(self._head)
            if len(head) < HEAD:
                self._head = head
                break
            self._head, size = b"", int.from_bytes(head[3:5], "big")
            cost = max(0.0, 1 - size / LARGE)
            if not self._own.take(cost):
                return False
            if not (self._steady.take(cost) or all(one.take(cost) for one in self._shared)):
                return False
            if not self._is_in_turn(head[0], size):
                return False
            at += size
        self._left = max(0, at - len(data))
        return True

    def _is_in_turn(self, kind: int, size: int) -> bool:
        """Whether a record of this type and size may come now."""
        if kind == CHANGE_CIPHER:
            self._finished = True
        if kind != HANDSHAKE:
            return True
        self._handshakes += 1
        self._handshake_bytes += size
        if self._finished:  # the last of a handshake
            self._handshakes = max(self._handshakes, MOST_HANDSHAKE)
        few = self._handshake_bytes <= LONGEST_HANDSHAKE
        return few and self._handshakes <= MOST_HANDSHAKE
