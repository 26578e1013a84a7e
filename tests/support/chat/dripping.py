"""A server whose answer comes letter by letter."""

import contextlib
import socket
import threading
import time


@contextlib.contextmanager
def dripping(begins):
    """A port at which an answer begins so, and goes on with a letter now and then, without end."""

    def drip(wire):
        with contextlib.suppress(OSError), wire:
            wire.recv(1 << 16)
            wire.sendall(begins)
            while True:
                wire.sendall(b"a")
                time.sleep(0.05)

    def accept():
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=drip, args=(listener.accept()[0],), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=accept, daemon=True).start()
        yield listener.getsockname()[1]
        listener.shutdown(socket.SHUT_RDWR)
