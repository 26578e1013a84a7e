"""The port of figures: answered, and not to be filled with silent connections."""

import socket
import time
import urllib.request

from prometheus_client import CollectorRegistry, Counter

from ico3d.chat.observing import figures_server


def _silent(port):
    return socket.create_connection(("127.0.0.1", port), timeout=20)


def test_silent_connections_are_closed_and_few(monkeypatch):
    monkeypatch.setattr(figures_server, "MOST_AT_ONCE", 2)
    monkeypatch.setattr(figures_server._Handler, "timeout", 0.3)
    registry = CollectorRegistry()
    Counter("ico3d_visitors", "Visitors.", registry=registry).inc(7)
    port = figures_server.serve_figures(registry, "127.0.0.1", 0)
    silent = [_silent(port) for _ in range(3)]
    assert [one.recv(1) for one in reversed(silent)] == [b""] * 3
    for one in silent:
        one.close()
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
        assert b"ico3d_visitors_total 7.0" in answer.read()


def test_a_request_that_comes_letter_by_letter_ends_in_time(monkeypatch):
    monkeypatch.setattr(figures_server, "LONGEST", 1.0)
    with _silent(figures_server.serve_figures(CollectorRegistry(), "127.0.0.1", 0)) as slow:
        slow.settimeout(0.1)
        begun, closed = time.monotonic(), False
        while not closed and time.monotonic() - begun < 60:
            try:
                slow.sendall(b"G")
                closed = slow.recv(1) == b""
            except TimeoutError:
                continue
            except OSError:
                closed = True
    assert closed
