"""`ico3d doctor`: finds what is wrong with a machine or a deployment, and says what helps."""

import asyncio
import contextlib
import gzip
import itertools
import json
import threading
import time
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.server import serve

from ico3d.chat.doctor import deployment, fetching, machine, visit
from ico3d.chat.doctor.deployment import Place
from ico3d.chat.serving.network.certificates import own_certificate
from ico3d.chat.serving.sites import Sites
from ico3d.cli import main
from ico3d.errors import SettingsError
from support.chat.dripping import dripping
from support.chat.serving import TYPED, free_port, serving

pytestmark = pytest.mark.slow


def grades(findings):
    return [finding.grade for finding in findings]


def told(findings, grade="bad"):
    return [f"{one.what}: {one.mend}" for one in findings if one.grade == grade]


def looked_at(url, key=""):
    """All that is found from outside, in a thread: the server runs in the loop."""
    return asyncio.to_thread(lambda: list(deployment.findings(url, key)))


async def test_a_server_that_is_well(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        found = await looked_at(url)
        while len(sessions):  # the doctor's place is free again
            await asyncio.sleep(0.01)
    assert not told(found), found
    assert "a conversation goes on after a lost connection (4 of 4)" in [f.what for f in found]


async def test_a_server_that_ends_or_has_not_the_session(bundle, monkeypatch):
    async with serving(bundle, TYPED) as (url, sessions):
        monkeypatch.setattr(sessions, "_resumable", lambda hello: False)  # as another one
        (lost,) = told(await looked_at(url))
        assert lost.startswith("a page that loses its connection reaches another server: ")
        sessions.line.close()
        assert told(await looked_at(url))[0].startswith("the server is about to end: ")


async def test_a_server_that_asks_for_a_key(bundle):
    key = "a key that nobody guesses"
    async with serving(bundle, TYPED, sites=Sites(key=key)) as (url, sessions):
        for wrong in ("", "another"):
            found = await looked_at(url, wrong)
            assert not told(found) and found[-1].grade == "weak" and "a key" in found[-1].what
            assert len(sessions) == 0
        found = await looked_at(url, key)
        assert not told(found) and "a conversation begins" in [one.what for one in found]


async def test_a_name_that_the_server_does_not_know(bundle):
    async with serving(bundle, TYPED) as (url, _):
        place = Place.of(url.replace("127.0.0.1", "127.1"))  # leads there, but is another name
        client = fetching.Client(place.url)
        found = await asyncio.to_thread(deployment.of_server, client, place)
    assert found.grade == "bad" and f"--name {place.host}" in found.mend


async def test_where_nothing_is():
    (found,) = await looked_at(f"http://127.0.0.1:{free_port()}")
    assert found.grade == "bad" and "does not answer" in found.what
    (found,) = await visit.Visitor(f"http://127.0.0.1:{free_port()}", None, "").findings()
    assert found.grade == "bad" and found.what.startswith("no WebSocket can be opened")


@pytest.mark.parametrize(
    "url", ["avatar.example", "ftp://a", "http://[", "http://a/b", "http://a:x"]
)
def test_what_is_no_address(url):
    with pytest.raises(SettingsError):
        Place.of(url)


def test_this_machine_and_an_avatar(bundle_path, tmp_path, capsys):
    found = list(machine.of_avatar(bundle_path, None))
    assert not told(found) and any("started in" in one.what for one in found)
    settings = tmp_path / "talk.toml"
    settings.write_text('[voice]\nuse = "nobody"\n')
    assert "voice 'nobody' is unknown" in told(machine.of_avatar(bundle_path, settings))[0]
    missing = Path("not-there.ico3d")
    assert main(["doctor", "--bundle", str(missing), "--port", str(free_port())]) == 1
    shown = capsys.readouterr()
    assert "✗ no conversation can begin: " in shown.out and "must be mended" in shown.err


def test_a_port_that_is_taken():
    from ico3d.chat.serving import server

    with server.bind("127.0.0.1", 0) as listener:
        listener.listen()
        assert machine.of_port(listener.getsockname()[1]).grade == "weak"
    assert machine.of_port(free_port()).grade == "good"


@contextlib.contextmanager
def answering(headers, pieces):
    """The address of a server that answers so to everything."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            with contextlib.suppress(OSError):
                for piece in pieces:
                    self.wfile.write(piece)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize("secure", [True, False])
async def test_a_key_is_sent_to_nobody_who_may_be_somebody_else(
    bundle, tmp_path, monkeypatch, secure
):
    key, asked = "a key that nobody guesses", []
    monkeypatch.setattr(deployment, "LOOPBACK", frozenset())
    monkeypatch.setattr(deployment, "token_for", lambda *given: asked.append(given))
    certificate = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC)) if secure else None
    async with serving(bundle, TYPED, sites=Sites(key=key), certificate=certificate) as (url, _):
        found = await looked_at(url, key)
    assert not asked
    (said,) = [one for one in told(found, "weak") if one.startswith("the key was not sent")]
    assert ("somebody else" in said) == secure


def test_an_answer_without_end_is_not_read_and_a_small_one_not_made_large():
    zeros = bytes(1 << 16)
    packed = gzip.compress(bytes(8 << 20), 9)
    for headers, pieces, most in [
        ({}, itertools.repeat(zeros), fetching.MOST_BYTES),
        ({"Content-Encoding": "gzip"}, [packed], len(packed)),
    ]:
        with answering(headers, pieces) as url:
            answer = fetching.fetch(fetching.Client(url), "/")
        assert answer.status == 200 and len(answer.body) == most and not answer.table
    assert answer.text == ""


def test_no_proxy_gets_what_is_for_the_server(monkeypatch):
    with answering({}, [b"a proxy"]) as proxy, answering({}, [b"the server"]) as url:
        for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, proxy)
        for name in ("NO_PROXY", "no_proxy"):
            monkeypatch.delenv(name, raising=False)
        assert fetching.fetch(fetching.Client(url), "/").text == "the server"


def test_cookies_of_a_proxy_are_kept():
    with answering({"Set-Cookie": "place=3"}, []) as url:
        client = fetching.Client(url)
        fetching.fetch(client, "/")
    assert dict(client.cookies) == {"place": "3"}
    assert client.cookies_for("/ws") == "place=3"


def test_odd_cookies_are_no_obstacle():
    """One name for two paths, as honest proxies do, and letters that no header can hold."""
    for cookie, kept in (("a=2; Path=/ws", "a=2; a=1"), ("b=caf\xe9; Path=/", "a=1")):
        with answering({"Set-Cookie": "a=1; Path=/"}, []) as url:
            client = fetching.Client(url)
            fetching.fetch(client, "/health")
        with answering({"Set-Cookie": cookie}, []) as other:
            client = fetching.Client(other, cookies=client.cookies)
            fetching.fetch(client, "/ws")
        assert client.cookies_for("/ws") == kept


@pytest.mark.parametrize("to", ["http://xn--a/", "javascript:x", "http://[bad", "http://a:99999/"])
async def test_an_address_that_is_none_is_a_finding(to):
    with answering({"Location": to}, []) as url, pytest.MonkeyPatch.context() as patch:
        patch.setattr(BaseHTTPRequestHandler, "send_response", _redirecting)
        found = await looked_at(url)
    assert found[-1].grade == "bad"


_respond = BaseHTTPRequestHandler.send_response


def _redirecting(handler, code):
    _respond(handler, 302)


@pytest.mark.parametrize("token", ["\ud800", "a b", "a\r\nHost: other", "t" * 5000, "", None, 7])
def test_a_token_that_no_address_can_hold_is_none(token):
    given = fetching.Answer(200, httpx.Headers(), json.dumps({"token": token}).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(deployment, "fetch", lambda *_, **__: given)
        assert deployment.token_for(fetching.Client("http://127.0.0.1:1"), "key") is None


async def test_no_server_sends_this_machine_elsewhere():
    """What only this machine reaches was asked in its name."""
    asked = []

    def elsewhere(wire, request):
        asked.append(request.path)

    async def silent(wire):
        await wire.wait_closed()

    async with serve(silent, "127.0.0.1", 0, process_request=elsewhere) as other:
        there = f"ws://127.0.0.1:{other.sockets[0].getsockname()[1]}/internal"

        def redirected(wire, request):
            answer = wire.respond(302, "")
            answer.headers["Location"] = there
            return answer

        async with serve(silent, "127.0.0.1", 0, process_request=redirected) as server:
            url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
            (found,) = await visit.Visitor(url, None, "").findings()
    assert found.what.startswith("no WebSocket can be opened (server rejected") and not asked


async def test_what_breaks_off_is_a_finding():
    with answering({"Content-Length": "10"}, [b"x"]) as url:
        found = await looked_at(url)
    assert found[-1].grade == "bad" and "RemoteProtocolError" in found[-1].what


async def test_a_server_that_says_nothing_is_not_waited_for(monkeypatch):
    async def silent(wire):
        if wire.request.path == "/echo":
            async for message in wire:
                await wire.send(message)
        await wire.wait_closed()

    monkeypatch.setattr(visit, "PATIENCE", 0.2)
    async with serve(silent, "127.0.0.1", 0) as server:
        url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        visitor = visit.Visitor(url, None, "")
        assert told(await visitor.findings())[-1].startswith(
            "no conversation begins (nothing came for 0.2 s)"
        )


async def test_a_server_that_takes_no_notice_of_an_end_is_left(monkeypatch):
    left = asyncio.Event()

    async def deaf(wire):
        wire.transport.pause_reading()
        await left.wait()
        wire.transport.abort()

    monkeypatch.setattr(visit, "PATIENCE", 0.2)
    async with serve(deaf, "127.0.0.1", 0) as server:
        url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        begun = time.monotonic()
        found = await visit.Visitor(url, None, "").findings()
        took = time.monotonic() - begun
        left.set()
    assert took < 5
    assert "no WebSocket can be opened (nothing came for 0.2 s)" in found[0].what


@pytest.mark.parametrize(
    ("scheme", "begins", "said"),
    [
        ("http", b"HTTP/1.1 200 OK\r\nX-Long: ", "no answer (ReadTimeout)"),
        ("https", b"\x16\x03\x03\x3f\xff", "no TLS connection (not within"),
    ],
)
def test_an_answer_that_drips_is_not_waited_for(monkeypatch, scheme, begins, said):
    monkeypatch.setattr(fetching, "PATIENCE", 0.5)
    monkeypatch.setattr(deployment, "PATIENCE", 0.5)
    with dripping(begins) as port:
        began, found = time.monotonic(), []
        for one in deployment.findings(f"{scheme}://127.0.0.1:{port}"):
            found.append(one)
            if time.monotonic() - began > 5:
                break
    assert any(one.what.startswith(said) for one in found), found
    assert time.monotonic() - began < 5
