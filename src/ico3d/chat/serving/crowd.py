"""How much of a server one visitor's machine may take."""

import contextlib
import ipaddress
from collections import Counter, OrderedDict
from collections.abc import Callable, Generator
from typing import Any

from ico3d.chat.bucket import Bucket

MOST_SOCKETS = 64
"""Open WebSockets of one machine; a classroom or an office may share its address."""
MOST_REQUESTS = 128
"""Requests of one machine that are worked on, whether their clients are still there or not."""
GONE = "ico3d.gone"
"""Name of the future in a WebSocket's scope that is done once its connection is lost: what the
server has closed waits for its client's answer, and takes as much memory meanwhile."""
REMEMBERED = 4096  # machines whose use is counted; of more, that of those who came last
UNKNOWN = "unknown"
"""All machines for which a proxy states something that is no address."""
OWN_NETWORK = 64  # bits of an IPv6 address that tell one household from another


class Crowd:
    """Counts what each machine has open: WebSockets, or requests."""

    def __init__(self, most: int = MOST_SOCKETS):
        """Starts without any; `most` is the largest number of one machine."""
        self._most = most
        self._open: Counter[str] = Counter()

    @contextlib.contextmanager
    def one_more(self, machine: str) -> Generator[bool, None, None]:
        """Counts one until it is closed; yields whether it may be opened.

        Args:
            machine: What `machine_of` returned.
        """
        if machine and self._open[machine] >= self._most:
            yield False
            return
        self._open[machine] += 1
        try:
            yield True
        finally:
            self._open[machine] -= 1
            if not self._open[machine]:
                del self._open[machine]


class Meters:
    """A bucket for each machine, for what it may do only so often."""

    def __init__(self, rate: float, burst: float, now: Callable[[], float]):
        """Starts with full buckets.

        Args:
            rate: What a machine may do per second for long.
            burst: What it may do at once.
            now: Returns the time in seconds.
        """
        self._make = lambda: Bucket(rate, burst, now)
        self._buckets: OrderedDict[str, Bucket] = OrderedDict()  # the one used last is the last

    def of(self, machine: str) -> tuple[Bucket, ...]:
        """The bucket of a machine; none for what `machine_of` does not know."""
        if not machine:
            return ()
        bucket = self._buckets.pop(machine, None) or self._make()
        self._buckets[machine] = bucket
        if len(self._buckets) > REMEMBERED:
            self._buckets.popitem(last=False)  # in no time, however many machines come
        return (bucket,)

    def take(self, machine: str) -> bool:
        """Counts one act of a machine; returns whether it is allowed."""
        return all(bucket.take(1) for bucket in self.of(machine))


def peer_of(client: tuple[str, int] | None, app: Any) -> str:
    """The machine at the other end of a connection; empty for proxies that the operator has stated.

    Args:
        client: Its address and port.
        app: What is served.
    """
    proxies = getattr(app, "trusted_hosts", ())
    return "" if client and client[0] in proxies else machine_of(client)


def machine_of(client: tuple[str, int] | None) -> str:
    """The machine, or the household, from which a connection comes.

    Args:
        client: Address and port of the connection, as in an ASGI scope.

    Returns:
        An IPv4 address or an IPv6 network; `UNKNOWN` for all of whom a proxy says something else.
        Empty for this machine itself and where nothing is said: behind a proxy that does not tell
        addresses, all visitors would be one.
    """
    try:
        address = ipaddress.ip_address(client[0]) if client else None
    except ValueError:
        return UNKNOWN if client and client[0] else ""
    if isinstance(address, ipaddress.IPv6Address):
        address = address.ipv4_mapped or address
    if address is None or address.is_loopback:
        return ""
    if isinstance(address, ipaddress.IPv4Address) or address.is_link_local:
        return str(address)
    return str(ipaddress.ip_network((address, OWN_NETWORK), strict=False))
