"""No cookie is read: Python's parser takes the square of a quoted value's length."""

import asyncio
import contextlib
import time

import pytest
from fastapi import FastAPI, Request, WebSocket

from ico3d.chat.serving.network.prompt import LARGEST_HEAD
from ico3d.chat.serving.server import make_app as make_avatar_app
from ico3d.chat.serving.sites import Sites
from ico3d.recording.app import make_app as make_studio_app
from ico3d.recording.app import open_room
from support.chat.remote import make_voice, service_app
from support.chat.serving import running

QUOTED = b'a="' + rb"\"" * (LARGEST_HEAD // 2 - 200) + b'"'
UPGRADE = (
    b"Connection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n"
)
APPS = {
    "serve": lambda body, _: make_avatar_app(body, None, "127.0.0.1"),
    "studio": lambda _, folder: make_studio_app(
        open_room(folder, "127.0.0.1", False), "127.0.0.1", Sites()
    ),
    "serve-module": lambda *_: service_app("voice", make_voice),
}
PATHS = {"serve": b"/health", "studio": b"/recordings/", "serve-module": b"/health"}


async def _status(port, path, header, more=b"Connection: close\r\n"):
    """The first line of an answer, and the processor time until it came."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    with contextlib.closing(writer):
        begun = time.process_time()
        writer.write(b"GET %s HTTP/1.1\r\nHost: 127.0.0.1\r\n%s%s\r\n" % (path, more, header))
        line = await reader.readline()
        return line.split()[1], time.process_time() - begun


@pytest.mark.parametrize("name", APPS)
async def test_a_long_cookie_costs_what_any_header_costs(name, body, tmp_path):
    app = APPS[name](body, tmp_path / "people")
    async with running(app) as (_, listener):
        port = listener.getsockname()[1]
        await _status(port, PATHS[name], b"")  # warms up
        other = [await _status(port, PATHS[name], b"X-Any: %s\r\n" % QUOTED) for _ in range(3)]
        cookie = [await _status(port, PATHS[name], b"Cookie: %s\r\n" % QUOTED) for _ in range(3)]
    assert {status for status, _ in other + cookie} == {b"200"}
    least = min(seconds for _, seconds in other)
    assert min(seconds for _, seconds in cookie) < 0.3 + 3 * least


@pytest.mark.parametrize("spelt", [b"Cookie", b"cookie", b"COOKIE"])
async def test_neither_routes_nor_websockets_see_a_cookie(spelt):
    app, seen = FastAPI(), []

    @app.get("/http")
    async def http(request: Request):
        seen.append(request.headers)

    @app.websocket("/ws")
    async def ws(socket: WebSocket):
        seen.append(socket.headers)
        await socket.accept()
        await socket.close()

    header = b"X-Before: 1\r\n%s: a=b\r\n%s: c=d\r\nX-After: 2\r\n" % (spelt, spelt)
    async with running(app) as (_, listener):
        port = listener.getsockname()[1]
        assert (await _status(port, b"/http", header))[0] == b"200"
        assert (await _status(port, b"/ws", header, UPGRADE))[0] == b"101"
    assert [(one.get("x-before"), one.get("x-after")) for one in seen] == [("1", "2")] * 2
    assert not any("cookie" in one for one in seen)
