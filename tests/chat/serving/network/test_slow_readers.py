"""Who reads an answer slowly gets all of it; who does not read holds no connection."""

import asyncio
import contextlib
import socket

import pytest
from fastapi import FastAPI
from fastapi.responses import Response

from ico3d.chat.serving.network import prompt
from support.chat.serving import running

REQUEST = b"GET /page HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


@pytest.mark.parametrize("reads", [True, False])
async def test_an_answer_arrives_as_a_whole_for_who_reads_it_slowly(monkeypatch, reads):
    monkeypatch.setattr(prompt, "HEAD", 0.3)
    size, speed = 200_000, 150_000
    app, line = FastAPI(), socket.socket()
    app.add_api_route("/page", lambda: Response(bytes(size)))
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    line.setblocking(False)
    loop, came = asyncio.get_running_loop(), 0
    async with running(app) as (_, listener):
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        await loop.sock_connect(line, listener.getsockname())
        await loop.sock_sendall(line, REQUEST)
        await asyncio.sleep(0 if reads else 1.5)
        with line, contextlib.suppress(ConnectionResetError):
            while came <= size and (piece := await loop.sock_recv(line, 4096)):
                came += len(piece)
                await asyncio.sleep(len(piece) / speed)
    assert (came > size) == reads
