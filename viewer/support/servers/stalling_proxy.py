"""A TCP proxy on this machine whose line can be made to stall.

Run: python stalling_proxy.py PORT

Prints the port that it listens on and carries bytes to and from PORT. While the line stalls
(`stall` on its standard input, until `flow`) it reads from neither side. Segments and the receive
buffer are those of an ordinary network: on loopback they are so large that the kernel would hold
a minute of sound before a browser noticed that nothing gets through.
"""

import contextlib
import socket
import sys
import threading

SEGMENT = 1460  # bytes
RECEIVE_BUFFER = 8192  # bytes; Linux doubles it
PIECE = 2048  # bytes that are read at once


class Line:
    """Carries bytes both ways while it flows."""

    def __init__(self, server: tuple[str, int]):
        """A line to a server."""
        self._server = server
        self._flowing = threading.Event()
        self._flowing.set()

    def obey(self, command: str) -> None:
        """Stalls or flows."""
        {"stall": self._flowing.clear, "flow": self._flowing.set}[command]()

    def carry(self, page: socket.socket) -> None:
        """Joins an accepted connection to the server."""
        server = socket.create_connection(self._server)
        for end, other in ((page, server), (server, page)):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._pour, args=(end, other), daemon=True).start()

    def _pour(self, source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while piece := source.recv(PIECE):
                self._flowing.wait()
                target.sendall(piece)
        for end in (source, target):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


def main() -> None:
    """Does what the file's docstring says."""
    line = Line(("127.0.0.1", int(sys.argv[1])))
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, SEGMENT)
    listener.bind(("127.0.0.1", 0))
    listener.listen()

    def accept() -> None:
        while True:
            line.carry(listener.accept()[0])

    threading.Thread(target=accept, daemon=True).start()
    print(listener.getsockname()[1], flush=True)
    for command in sys.stdin:  # ends with its parent
        line.obey(command.strip())


if __name__ == "__main__":
    main()
