"""TLS towards servers that may send each byte in a record of its own, or ask for hard sums.

anyio hands over one record at each read without a turn for others, and the HTTP library above it
looks at each piece anew. A server that names the numbers of a Diffie-Hellman exchange itself has a
client compute for 0.6 s.
"""

import os
import ssl
from collections.abc import Callable
from functools import lru_cache
from typing import Any

CIPHERS = "ECDHE+AESGCM:ECDHE+CHACHA20"
"""What is asked for by TLS 1.2; TLS 1.3 has its own. Both make keys on elliptic curves."""
CURVE = "prime256v1"
"""The one curve on which keys are made, which all servers have."""


class JoinedRecords(ssl.SSLObject):
    """A connection that hands over all records that have come, as if they were one."""

    def read(self, len: int = 1024, buffer: Any = None) -> Any:
        """Up to `len` bytes of what has come, by as many records as they need.

        Raises:
            SSLError: If none has come, or the connection has ended; what came before an end is
                handed over first.
        """
        once = super().read
        return once(len, buffer) if buffer is not None else _joined(once, len)


def _joined(read: Callable[[int], bytes], most: int) -> bytes:
    """What several reads give; the first of them says why there is nothing."""
    joined = bytearray(read(most))
    while joined and len(joined) < most:
        try:
            part = read(most - len(joined))
        except ssl.SSLError:  # the next read says so again
            break
        if not part:
            break
        joined += part
    return bytes(joined)


def client_context(trust_env: bool = True) -> ssl.SSLContext:
    """The context of clients, with the certificates that httpx trusts. Slow when first called.

    Args:
        trust_env: Whether the environment may name others.
    """
    return _client_context(trust_env, _named())


def system_context() -> ssl.SSLContext:
    """The context of clients that trust the certificates of the system. Slow when first called."""
    return _system_context(_named())


def _named() -> tuple[str | None, ...]:
    """The certificates that the environment names."""
    return tuple(map(os.environ.get, ("SSL_CERT_FILE", "SSL_CERT_DIR")))


# Reading all certificates takes 25 ms, for which everybody would wait at each call. Those of a
# later date are read when the server starts again.
@lru_cache
def _client_context(trust_env: bool, named: tuple[str | None, ...]) -> ssl.SSLContext:
    import httpx2

    context = _quick(httpx2.create_ssl_context(trust_env=trust_env))
    context.sslobject_class = JoinedRecords
    return context


@lru_cache
def _system_context(named: tuple[str | None, ...]) -> ssl.SSLContext:
    return _quick(ssl.create_default_context())


def _quick(context: ssl.SSLContext) -> ssl.SSLContext:
    """A client's context, changed so that no server can have it compute for long."""
    context.set_ciphers(CIPHERS)
    context.set_ecdh_curve(CURVE)
    return context
