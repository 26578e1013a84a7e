"""Frames that are no messages hold up nobody, and who does not read is not waited for."""

import asyncio
import contextlib

import pytest
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from ico3d.chat.serving.crowd import GONE, Crowd
from ico3d.chat.serving.guard import Guard
from ico3d.chat.serving.network import websocket
from ico3d.chat.wire.protocol import MAX_BURST, MAX_RATE
from support.chat.serving import running
from support.chat.waiting import until

HEAD = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n"
)
FLOODS = {"ping": Opcode.PING, "pong": Opcode.PONG, "empty pieces": Opcode.CONT}


def frame(opcode, data=b"", fin=True):
    return Frame(opcode, data, fin).serialize(mask=True)


class Served:
    """A server whose one page does what a test wants."""

    def __init__(self):
        self.went, self.code = asyncio.Event(), None
        self.page = self.take_all
        self.taken = []

    async def take_all(self, socket):
        while True:
            self.taken.append(await socket.receive_text())

    async def run(self, socket: WebSocket):
        await socket.accept()
        try:
            await self.page(socket)
        except WebSocketDisconnect as error:
            self.code = error.code
        finally:
            self.went.set()

    @property
    def line(self):
        """The server's side of its only WebSocket."""
        (line,) = self.running.server_state.connections
        return line

    async def left(self):
        await asyncio.wait_for(self.went.wait(), 5)

    @contextlib.asynccontextmanager
    async def connected(self):
        """A client that has seen the handshake's answer begin, and reads no more."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port, limit=1)
        writer.write(HEAD + b"\r\n")
        assert await reader.read(1) == b"H"
        try:
            yield writer
        finally:
            writer.transport.abort()


@pytest.fixture
async def served():
    served, app = Served(), FastAPI()
    app.add_api_websocket_route("/", served.run)
    async with running(app) as (served.running, listener):
        served.port = listener.getsockname()[1]
        yield served


@pytest.mark.parametrize("kind", FLOODS)
async def test_a_flood_of_frames_is_ended_in_a_sentence(served, kind):
    opcode = FLOODS[kind]
    async with connect(f"ws://127.0.0.1:{served.port}/", ping_interval=None) as socket:
        begun = frame(Opcode.TEXT, fin=False) if opcode is Opcode.CONT else b""
        more = frame(opcode, fin=opcode is not Opcode.CONT)
        socket.transport.write(begun + more * (2 * websocket.AT_ONCE))
        with pytest.raises(ConnectionClosed):
            await asyncio.wait_for(socket.recv(), 5)
    assert (socket.close_code, socket.close_reason) == (
        1008,
        "more than 100 control frames and fragments per second.",
    )
    await served.left()
    assert served.code == 1008


async def test_messages_after_a_flood_are_not_taken(served):
    async with served.connected() as writer:
        flood = frame(Opcode.PING) * (websocket.AT_ONCE + 9)
        writer.write(flood + frame(Opcode.TEXT, b"late") * 100)
        await served.left()
    assert served.taken == []


async def test_as_many_messages_in_two_pieces_as_a_page_may_send_are_taken(served):
    pieces = frame(Opcode.TEXT, b"a", fin=False) + frame(Opcode.PING) + frame(Opcode.CONT, b"b")
    async with served.connected() as writer:
        writer.write(pieces * MAX_BURST)
        while len(served.taken) < MAX_BURST:
            await asyncio.sleep(0.01)
        assert served.line.read_paused is False
    assert served.taken == ["ab"] * MAX_BURST


async def test_pieces_at_the_rate_of_messages_are_taken_for_long(served, monkeypatch):
    now = [0.0]
    bucket = websocket.Bucket
    monkeypatch.setattr(websocket, "Bucket", lambda *of: bucket(*of[:2], lambda: now[0]))
    async with served.connected() as writer:
        for second in range(1, 21):
            writer.write((frame(Opcode.TEXT, b"a", False) + frame(Opcode.CONT)) * MAX_RATE)
            while len(served.taken) < second * MAX_RATE:
                await asyncio.sleep(0.001)
            now[0] += 1.0


async def test_what_came_at_once_waits_unparsed_until_messages_are_taken(served):
    free = asyncio.Event()

    async def page(socket):
        await free.wait()
        await served.take_all(socket)

    served.page = page
    sent = [str(number) for number in range(10_000)]
    async with served.connected() as writer:
        writer.write(b"".join(frame(Opcode.TEXT, word.encode()) for word in sent))
        await asyncio.sleep(0.1)
        assert 0 < served.line.queue.qsize() <= websocket.SLICE // 6
        free.set()
        writer.write(frame(Opcode.CLOSE))
        await served.left()
    assert served.taken == sent


async def test_answers_that_nobody_reads_are_not_kept_without_end(served, monkeypatch):
    monkeypatch.setattr(websocket, "AT_ONCE", 1e9)
    monkeypatch.setattr(websocket, "LARGEST_BACKLOG", 1 << 18)
    async with served.connected() as writer:
        with contextlib.suppress(ConnectionError):
            for _ in range(200):  # 26 MB
                writer.write(frame(Opcode.PING, b"x" * 125) * 1000)
                await writer.drain()
        await served.left()
    assert served.code in (1005, 1006)


async def test_a_closed_connection_does_not_wait_for_who_does_not_read(served, monkeypatch):
    monkeypatch.setattr(websocket, "LAST_WORDS", 0.1)

    async def page(socket):
        await socket.send_bytes(bytes(1 << 24))
        await served.take_all(socket)

    served.page = page
    async with served.connected() as writer:
        writer.write(frame(Opcode.CLOSE))
        async with asyncio.timeout(5):
            await served.left()
            while served.running.server_state.connections:
                await asyncio.sleep(0.01)


@pytest.mark.parametrize("late", [frame(Opcode.TEXT), frame(Opcode.BINARY, b"x")])
async def test_who_goes_on_behind_the_last_word_is_not_heard(served, monkeypatch, late):
    """Nothing takes messages then, so that nothing paused their parsing."""
    monkeypatch.setattr(websocket, "LAST_WORDS", 60.0)
    parsed = []
    monkeypatch.setattr(
        websocket.BoundedWebSocket, "handle_text", lambda _, event: parsed.append(event)
    )
    monkeypatch.setattr(
        websocket.BoundedWebSocket, "handle_bytes", lambda _, event: parsed.append(event)
    )

    async def page(socket):
        await socket.close(1013, "enough")

    served.page = page
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(HEAD + b"\r\n")
    await served.left()
    async with asyncio.timeout(5):
        with contextlib.suppress(ConnectionError):
            while not reader.at_eof():
                writer.write(late * 2000)
                await writer.drain()
                await asyncio.sleep(0.01)
    assert 0 < len(parsed) <= (websocket.LATE + websocket.SLICE) // 6
    writer.transport.abort()


async def test_what_crosses_the_last_word_does_not_take_its_reason(served):
    async def page(socket):
        await socket.receive_text()
        await socket.close(1013, "enough")

    served.page = page
    async with connect(f"ws://127.0.0.1:{served.port}/", ping_interval=None) as socket:
        socket.transport.write(frame(Opcode.TEXT, b"x" * 90) * 30)
        with pytest.raises(ConnectionClosed):
            await asyncio.wait_for(socket.recv(), 5)
    assert (socket.close_code, socket.close_reason) == (1013, "enough")


async def test_a_head_that_websockets_does_not_read_is_not_waited_with(served):
    more = b"".join(b"X-%d: a\r\n" % number for number in range(150))
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(HEAD + more + b"\r\n")
    with contextlib.suppress(ConnectionError):
        assert await asyncio.wait_for(reader.read(), 5) == b""
    writer.close()
    assert not served.went.is_set()


async def test_what_the_server_has_closed_counts_until_it_is_gone(served, monkeypatch):
    """Whoever does not answer that the line is closed holds it no longer than others wait."""
    monkeypatch.setattr(websocket, "peer_of", lambda client, app: "203.0.113.7")
    monkeypatch.setattr(websocket, "_lines", Crowd(3))

    async def close(socket):
        await socket.close(1008)

    served.page, count = close, websocket._lines._open
    lines = [await asyncio.open_connection("127.0.0.1", served.port) for _ in range(5)]
    for _, writer in lines:
        writer.write(HEAD + b"\r\n")
    await until(lambda: sum(count.values()) == 3)
    begun = asyncio.get_running_loop().time()
    for reader, _ in lines:
        with contextlib.suppress(ConnectionError):
            await asyncio.wait_for(reader.read(), 30)
    assert asyncio.get_running_loop().time() - begun < websocket.FAREWELL + 5
    await until(lambda: not count)
    for _, writer in lines:
        writer.close()


async def test_a_place_in_the_crowd_is_kept_until_the_line_is_gone():
    gone, crowd = asyncio.get_running_loop().create_future(), Crowd()

    async def app(scope, receive, send):
        return None

    guard = Guard(app, "127.0.0.1")
    guard._crowd = crowd
    headers = [(b"host", b"127.0.0.1:80")]
    scope = {"type": "websocket", "path": "/echo", "headers": headers, "query_string": b""}
    await guard({**scope, "client": ("203.0.113.7", 9), GONE: gone}, None, None)
    assert crowd._open["203.0.113.7"] == 1
    gone.set_result(None)
    await asyncio.sleep(0)
    assert not crowd._open
