"""Addresses under which other machines reach this one."""

import ipaddress
import socket

import psutil

ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
"""Addresses reserved for documentation: a route to them is one to everywhere."""


def machine_addresses(host: str) -> list[str]:
    """Addresses of this machine on which a server that is bound to `host` is reached.

    Args:
        host: Address to which the server is bound; `0.0.0.0` and `::` stand for all.

    Returns:
        The address of the default route first; for `host` of one interface, only that.
    """
    if host not in ("0.0.0.0", "::"):
        return [host]
    families = [socket.AF_INET] if host == "0.0.0.0" else [socket.AF_INET, socket.AF_INET6]
    up = {name for name, stats in psutil.net_if_stats().items() if stats.isup}
    found = [
        entry.address
        for name, entries in psutil.net_if_addrs().items()
        if name in up
        for entry in entries
        if entry.family in families and _is_reachable(entry.address)
    ]
    first = [_outward(family) for family in families]
    return sorted(dict.fromkeys(found), key=lambda address: address not in first)


def _is_reachable(text: str) -> bool:
    """Whether other machines can use the address as it is."""
    address = ipaddress.ip_address(text.partition("%")[0])
    return not (address.is_loopback or address.is_link_local or address.is_unspecified)


def _outward(family: socket.AddressFamily) -> str | None:
    """The address from which this machine would reach others; nothing is sent."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((ELSEWHERE[family], 9))
            return probe.getsockname()[0]
        except OSError:
            return None  # no such network
