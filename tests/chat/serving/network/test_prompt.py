"""Who is slow, or opens connections without end, holds none of them for long."""

import asyncio
import contextlib

import pytest

from ico3d.chat.serving.network import prompt
from support.chat.serving import serving

REQUEST = b"GET /health HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n"


@pytest.fixture
async def port(body):
    async with serving(body) as (url, _):
        yield int(url.rstrip("/").rpartition(":")[2])


@contextlib.asynccontextmanager
async def connected(port):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield reader, writer
    finally:
        writer.close()


async def seconds_until_closed(reader):
    now = asyncio.get_running_loop().time
    begun = now()
    with contextlib.suppress(ConnectionResetError):
        while await asyncio.wait_for(reader.read(1 << 16), 60):
            pass
    return now() - begun


@pytest.mark.parametrize("sent", [b"", b"GET /", b"\r\n" * 9, REQUEST % 1])
async def test_a_head_that_does_not_come_is_not_waited_for(port, sent):
    async with connected(port) as (reader, writer):
        writer.write(sent)
        assert 9 < await seconds_until_closed(reader) < 12


@pytest.mark.parametrize("drop", [b"X-Slow: yes\r\n", b"\r\n"])
async def test_dripping_holds_no_connection(port, drop):
    """Neither within the first head, nor by empty lines before the next one."""
    async with connected(port) as (reader, writer):
        writer.write(REQUEST % port + (b"\r\n" if drop == b"\r\n" else b""))

        async def drip():
            with contextlib.suppress(ConnectionError):
                while True:
                    await asyncio.sleep(1.5)
                    writer.write(drop)
                    await writer.drain()

        dripping = asyncio.create_task(drip())
        assert 9 < await seconds_until_closed(reader) < 13
        dripping.cancel()


async def test_a_head_without_end_is_cut_off(port):
    async with connected(port) as (reader, writer):
        writer.write(REQUEST % port + b"X-Long: " + b"x" * (prompt.LARGEST_HEAD + 1))
        assert await seconds_until_closed(reader) < 1


async def test_a_slow_but_honest_client_is_answered(port):
    async with connected(port) as (reader, writer):
        for _ in range(2):  # on the same connection
            for piece in (REQUEST % port, b"X-A: b\r\n", b"\r\n"):
                await asyncio.sleep(2)
                writer.write(piece)
            assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
            await reader.readexactly(len(b'{"ok":true}'))


async def test_one_machine_opens_so_many_connections_and_no_more(port, monkeypatch):
    monkeypatch.setattr(prompt, "MOST_OPEN", 3)
    monkeypatch.setattr(prompt, "machine_of", lambda client: client and "10.0.0.7")
    async with contextlib.AsyncExitStack() as held:
        lines = [await held.enter_async_context(connected(port)) for _ in range(4)]
        assert await seconds_until_closed(lines[3][0]) < 1
        lines[0][1].write(REQUEST % port + b"\r\n")
        assert (await lines[0][0].readline()).startswith(b"HTTP/1.1 200")
    await asyncio.sleep(1)
    async with connected(port) as (reader, writer):
        writer.write(REQUEST % port + b"\r\n")
        assert (await reader.readline()).startswith(b"HTTP/1.1 200")
    await asyncio.sleep(1)
    assert prompt._open["10.0.0.7"] == 0


def test_the_system_is_asked_for_connections(monkeypatch):
    given = []
    monkeypatch.setattr(prompt.resource, "getrlimit", lambda _: (1024, 524_288))
    monkeypatch.setattr(prompt.resource, "setrlimit", lambda _, limits: given.append(limits))
    prompt.allow_many_connections()
    monkeypatch.setattr(prompt.resource, "getrlimit", lambda _: (20_000, 20_000))
    prompt.allow_many_connections()
    assert given == [(65_536, 524_288)]
