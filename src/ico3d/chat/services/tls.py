"""TLS towards servers that may send each byte in a record of its own, or ask for hard sums.

anyio hands over one record at each read without a turn for others, and the HTTP library above it
looks at each piece anew. A server that names the numbers of a Diffie-Hellman exchange itself has a
client compute for 0.6 s.
"""

import ssl
from collections.abc import Callable
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
    """A context for clients, with the certificates that httpx trusts. Slow when first called.

    Args:
        trust_env: Whether the environment may name others.
    """
    import httpx2

    context = quick(httpx2.create_ssl_context(trust_env=trust_env))
    context.sslobject_class = JoinedRecords
    return context


def quick(context: ssl.SSLContext) -> ssl.SSLContext:
    """A client's context, changed so that no server can have it compute for long."""
    context.set_ciphers(CIPHERS)
    context.set_ecdh_curve(CURVE)
    return context
