"""The server of an operator's figures, which silent connections and long heads cannot fill."""

import contextlib
import io
import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from prometheus_client import CONTENT_TYPE_PLAIN_0_0_4, CollectorRegistry, generate_latest

SILENCE = 10.0
"""Seconds after which a connection without a request is closed."""
LONGEST = 20.0
"""Seconds after which any connection is closed, such as one that sends a letter now and then."""
LONGEST_HEAD = 16_384
"""Bytes of a request."""
MOST_AT_ONCE = 16
"""Connections at the same time, each of which takes a thread; the oldest gives way to a new one."""
GIVING_WAY = 1.0
"""Seconds that this may take."""


class _Handler(BaseHTTPRequestHandler):
    """Answers every path with the figures, in one format whatever is accepted; logs nothing."""

    timeout = SILENCE
    registry: CollectorRegistry

    def setup(self) -> None:
        """Opens the connection, of which only so much is read."""
        super().setup()
        self.rfile = io.BufferedReader(_Head(self.rfile))

    def do_GET(self) -> None:
        """Answers with the figures."""
        text = generate_latest(self.registry)
        self.send_response(200)
        self.send_header("Content-Type", CONTENT_TYPE_PLAIN_0_0_4)
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, format: str, *args: Any) -> None:
        """Logs nothing."""


class _Head(io.RawIOBase):
    """The first `LONGEST_HEAD` bytes of a connection; who sends more gets no answer."""

    def __init__(self, connection: io.BufferedIOBase):
        self._connection, self._left = connection, LONGEST_HEAD

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Reads what has come.

        Raises:
            ConnectionAbortedError: If it is too much.
        """
        data = self._connection.read1(len(buffer))
        self._left -= len(data)
        if self._left < 0:
            raise ConnectionAbortedError
        buffer[: len(data)] = data
        return len(data)


class _Server(ThreadingHTTPServer):
    """A thread for each connection, up to `MOST_AT_ONCE`."""

    def __init__(self, *arguments: Any, **options: Any):
        self._places = threading.BoundedSemaphore(MOST_AT_ONCE)
        self._open: dict[socket.socket, None] = {}  # the oldest first
        super().__init__(*arguments, **options)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Begins to answer; whoever has kept a place for longest loses it, if there is none."""
        place = self._places.acquire(blocking=False)
        if not place:
            for oldest in list(self._open)[:1]:
                _end(oldest)
            place = self._places.acquire(timeout=GIVING_WAY)
        if place:
            self._open[request] = None
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answers, in time or not at all, and gives the place back."""
        end = threading.Timer(LONGEST, _end, [request])
        end.daemon = True
        end.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            end.cancel()
            self._open.pop(request, None)
            self._places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Says nothing of clients that went away."""


class _Server6(_Server):
    address_family = socket.AF_INET6


def _end(connection: socket.socket) -> None:
    """Ends a connection, whatever its thread waits for."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


def serve_figures(registry: CollectorRegistry, host: str, port: int) -> int:
    """Serves figures in a thread of its own.

    Args:
        registry: The figures.
        host: Address to listen on.
        port: Port to listen on; 0 takes any free port.

    Returns:
        The port.

    Raises:
        OSError: If the port cannot be opened.
    """
    kind = _Server6 if ":" in host else _Server
    server = kind((host, port), type("Figures", (_Handler,), {"registry": registry}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server.server_port
