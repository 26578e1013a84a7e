"""A server with HTTPS, and the socket by which visitors check their way to it."""

import asyncio
import contextlib
import socket
import ssl
import time
from datetime import UTC, datetime

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from ico3d.chat.serving.network.certificates import own_certificate
from support.chat.serving import serving, visiting


async def test_page_and_socket_come_by_https(body, tmp_path):
    certificate = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    trust = ssl.create_default_context(cafile=certificate.file)
    async with serving(body, certificate=certificate) as (url, _):
        assert url.startswith("https://127.0.0.1:")
        async with visiting(verify=trust) as client:
            assert (await client.get(f"{url}health")).json() == {"ok": True}
        async with connect(url.replace("https", "wss") + "echo", ssl=trust) as wire:
            await wire.send("12.5")
            assert await wire.recv() == "12.5"


HEAD = (
    b"GET /echo HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def flooded(port, trust, seconds):
    """For how many seconds, of so many, a server hears somebody who hears nothing."""
    pong = Frame(Opcode.PONG, b"").serialize(mask=True)
    with socket.create_connection(("127.0.0.1", port)) as plain:
        line = trust.wrap_socket(plain, server_hostname="127.0.0.1")
        line.sendall(HEAD)
        assert line.recv(4096).startswith(b"HTTP/1.1 101")
        begun = time.monotonic()
        with contextlib.suppress(OSError):
            while time.monotonic() - begun < seconds:
                line.sendall(pong * 2700)
        return time.monotonic() - begun


def test_who_floods_by_https_is_not_heard_until_they_stop(body, tmp_path):
    uvloop = pytest.importorskip("uvloop")  # which servers have where it is; asyncio ends sooner
    certificate = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    trust = ssl.create_default_context(cafile=certificate.file)

    async def seconds():
        async with serving(body, certificate=certificate) as (url, _):
            port = int(url.rstrip("/").rpartition(":")[2])
            return await asyncio.to_thread(flooded, port, trust, 4)

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        assert runner.run(seconds()) < 2


@pytest.mark.parametrize("sent", ["x" * 65, b"bytes"])
async def test_the_echo_is_for_short_texts(body, sent):
    async with serving(body) as (url, _), connect(url.replace("http", "ws") + "echo") as wire:
        await wire.send(sent)
        with pytest.raises(ConnectionClosed):
            await wire.recv()


async def test_the_echo_has_an_end(body):
    async with serving(body) as (url, _), connect(url.replace("http", "ws") + "echo") as wire:
        for number in range(32):
            await wire.send(str(number))
            assert await wire.recv() == str(number)
        with pytest.raises(ConnectionClosed):
            await wire.recv()
