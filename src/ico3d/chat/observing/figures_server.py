"""The server of an operator's figures, which strangers cannot fill with silent connections."""

import contextlib
import socket
import threading
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from prometheus_client import CollectorRegistry, make_wsgi_app

SILENCE = 10.0
"""Seconds after which a connection without a request is closed."""
LONGEST = 20.0
"""Seconds after which any connection is closed, such as one that sends a letter now and then."""
MOST_AT_ONCE = 16
"""Connections at the same time, each of which takes a thread."""


class _Handler(WSGIRequestHandler):
    """Answers, and logs nothing of it."""

    timeout = SILENCE

    def log_message(self, format: str, *args: Any) -> None:
        """Logs nothing."""


class _Server(ThreadingMixIn, WSGIServer):
    """A thread for each connection, up to `MOST_AT_ONCE`; further ones are closed."""

    daemon_threads = True

    def __init__(self, *arguments: Any, **options: Any):
        self._places = threading.BoundedSemaphore(MOST_AT_ONCE)
        super().__init__(*arguments, **options)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Begins to answer, where there is a place."""
        if self._places.acquire(blocking=False):
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
    server = make_server(host, port, make_wsgi_app(registry), kind, _Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server.server_port
