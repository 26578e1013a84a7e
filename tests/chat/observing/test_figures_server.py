"""The port of figures: answered, and not to be filled by silent connections or long heads."""

import contextlib
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
    assert [one.recv(1) for one in silent] == [b""] * 3
    for one in silent:
        one.close()
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
        assert b"ico3d_visitors_total 7.0" in answer.read()


def test_whoever_keeps_renewing_silent_connections_keeps_nobody_out(monkeypatch):
    monkeypatch.setattr(figures_server, "MOST_AT_ONCE", 3)
    port = figures_server.serve_figures(CollectorRegistry(), "127.0.0.1", 0)
    silent = []
    for _ in range(5):
        silent += [_silent(port) for _ in range(5)]
        assert _answer(port, b"GET /metrics HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.0 200")
    for one in silent:
        one.close()


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


def _answer(port, head):
    with _silent(port) as connection:
        with contextlib.suppress(OSError):
            connection.sendall(head)
        answer = b""
        with contextlib.suppress(OSError):
            while data := connection.recv(65536):
                answer += data
    return answer


def test_what_is_accepted_changes_nothing(capfd):
    registry = CollectorRegistry()
    Counter("ico3d_visitors", "Visitors.", registry=registry).inc(7)
    port = figures_server.serve_figures(registry, "127.0.0.1", 0)
    for accept in (b"text/plain;version=x", b"application/openmetrics-text", b"ab," * 4000):
        answer = _answer(port, b"GET /metrics HTTP/1.1\r\nAccept: " + accept + b"\r\n\r\n")
        assert answer.startswith(b"HTTP/1.0 200") and b"ico3d_visitors_total 7.0" in answer
        assert b"version=0.0.4" in answer
    assert capfd.readouterr().err == ""


def test_a_long_head_gets_no_answer_and_is_not_read_on(monkeypatch, capfd):
    port = figures_server.serve_figures(CollectorRegistry(), "127.0.0.1", 0)
    line = b"Accept: " + b"ab," * 20_000 + b"\r\n"
    assert _answer(port, b"GET /metrics HTTP/1.1\r\n" + 100 * line + b"\r\n") == b""
    assert _answer(port, b"GET " + b"/" * 60_000 + b" HTTP/1.1\r\n\r\n") == b""
    assert capfd.readouterr().err == ""
