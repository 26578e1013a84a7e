"""A body that goes on behind the answer to its request is read for a while, and not for ever."""

import asyncio
import contextlib

import pytest

from ico3d.chat.serving.network.prompt import LEFT_OVER
from support.chat.serving import serving

HEAD = b"POST /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n"
CODINGS = {
    "chunks": b"Transfer-Encoding: chunked\r\n\r\n",
    "a length": b"Content-Length: 99999999999\r\n\r\n",
}
PIECE = 1 << 12


@pytest.fixture
async def line(body):
    """A connection to a server."""
    async with serving(body) as (url, _):
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", int(url.rstrip("/").rpartition(":")[2])
        )
        yield reader, writer
        writer.close()


def piece(coding):
    return b"%x\r\n%s\r\n" % (PIECE, bytes(PIECE)) if coding == "chunks" else bytes(PIECE)


@pytest.mark.parametrize("coding", CODINGS)
async def test_without_an_end_it_is_cut_off(line, coding):
    reader, writer = line
    writer.write(HEAD + CODINGS[coding])
    assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 4")
    sent = 0
    with pytest.raises(ConnectionError):
        while sent < 200 * LEFT_OVER:
            writer.write(piece(coding))
            await writer.drain()
            sent += PIECE
    assert sent >= LEFT_OVER  # what lies in the sockets comes on top


async def test_what_has_an_end_soon_is_read_and_the_next_request_answered(line):
    reader, writer = line
    writer.write(HEAD + b"Content-Length: %d\r\n\r\n" % LEFT_OVER)
    head = await reader.readuntil(b"\r\n\r\n")
    length = int(head.lower().split(b"content-length:")[1].split()[0])
    await reader.readexactly(length)
    for _ in range(LEFT_OVER // PIECE):
        writer.write(bytes(PIECE))
        await writer.drain()
    writer.write(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    async with asyncio.timeout(20):
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")


async def test_the_same_connection_may_have_as_much_behind_each_answer(line):
    reader, writer = line
    for _ in range(3):
        writer.write(HEAD + b"Content-Length: %d\r\n\r\n" % (LEFT_OVER - 1))
        writer.write(bytes(LEFT_OVER - 1))
        head = await reader.readuntil(b"\r\n\r\n")
        await reader.readexactly(int(head.lower().split(b"content-length:")[1].split()[0]))
    with contextlib.suppress(TimeoutError):
        assert await asyncio.wait_for(reader.read(1), 0.3) != b""
