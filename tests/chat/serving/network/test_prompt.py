"""Who is slow, or opens connections without end, holds none of them for long."""

import asyncio
import contextlib
import gc
import re
import time
import weakref
from pathlib import Path

import pytest
from fastapi import FastAPI, Request
from fastapi.responses import FileResponse
from websockets.server import ServerProtocol

import ico3d
from ico3d.chat.serving import crowd
from ico3d.chat.serving.network import prompt
from support.chat.serving import running, serving
from support.chat.waiting import until

SOURCES = Path(ico3d.__file__).parent
REQUEST = b"GET /health HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n"
HOST = b" HTTP/1.1\r\nHost: 127.0.0.1\r\n"
UPGRADE = (
    b"Upgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n"
)


@pytest.fixture
async def port(body):
    async with serving(body) as (url, _):
        yield int(url.rstrip("/").rpartition(":")[2])


@pytest.fixture
async def unread(tmp_path):
    """A server of a file too long to be sent unread, of a body's length, a header, and no answer.

    Yields its port and its tasks.
    """
    app, file = FastAPI(), tmp_path / "file"
    file.touch()
    with file.open("r+b") as hole:
        hole.truncate(1 << 24)
    app.add_api_route("/file", lambda: FileResponse(file))

    @app.post("/length")
    async def length(request: Request):
        return len(await request.body())

    @app.post("/name")
    async def name(request: Request):
        await request.body()
        return request.headers.getlist("x-forwarded-for")

    @app.get("/nothing")
    async def nothing(request: Request):
        while (await request.receive())["type"] != "http.disconnect":
            pass

    async with running(app) as (served, listener):
        yield listener.getsockname()[1], served.server_state.tasks


async def seconds_until_over(tasks):
    now = asyncio.get_running_loop().time
    begun = now()
    async with asyncio.timeout(60):
        while tasks:
            await asyncio.sleep(0.01)
    return now() - begun


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


@pytest.mark.parametrize(
    "behind",
    [
        (b"GET /" + HOST + b"\r\n") * 2,
        b"GET /echo" + HOST + UPGRADE + b"\r\n",
        b"GET /" + HOST + b"X-Long: " + b"x" * (prompt.LARGEST_HEAD + 1),
        b"GET /" + HOST + b"a: b\r\n" * (prompt.MOST_HEADERS + 1),
    ],
    ids=["requests", "a WebSocket", "a long head", "many headers"],
)
async def test_behind_an_answer_that_is_not_read_not_much_may_wait(unread, behind):
    port, tasks = unread
    reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=1)
    writer.write(b"GET /file" + HOST + b"\r\n")
    assert await reader.read(1) == b"H"
    await asyncio.sleep(0.1)  # until no more can be sent
    writer.write(behind)
    assert await seconds_until_over(tasks) < 2
    writer.transport.abort()


async def test_who_leaves_while_a_request_waits_is_not_worked_for(unread):
    port, tasks = unread
    async with connected(port) as (_, writer):
        writer.write((b"GET /nothing" + HOST + b"\r\n") * 2)
        while not tasks:
            await asyncio.sleep(0.01)
    assert await seconds_until_over(tasks) < 2


async def test_a_request_that_waited_leaves_nothing_behind(unread, monkeypatch):
    port, tasks = unread
    lines = []
    made = prompt.PromptProtocol.connection_made

    def remembered(self, transport):
        lines.append(weakref.ref(self))
        made(self, transport)

    monkeypatch.setattr(prompt.PromptProtocol, "connection_made", remembered)
    gc.collect()
    gc.disable()
    try:
        async with connected(port) as (_, writer):
            writer.write((b"GET /nothing" + HOST + b"\r\n") * 2)
            while not tasks:
                await asyncio.sleep(0.01)
            await asyncio.sleep(0.1)
        await seconds_until_over(tasks)
        await until(lambda: lines[0]() is None)
    finally:
        gc.enable()


async def test_one_request_may_wait_for_another(port):
    async with connected(port) as (reader, writer):
        writer.write((REQUEST % port + b"\r\n") * 2)
        for _ in range(2):
            assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
            await reader.readexactly(len(b'{"ok":true}'))


@pytest.mark.parametrize("more, answered", [(0, True), (1, False)])
async def test_a_request_has_so_many_headers_and_no_more(port, more, answered):
    async with connected(port) as (reader, writer):
        writer.write(REQUEST % port + b"a: b\r\n" * (prompt.MOST_HEADERS - 1 + more) + b"\r\n")
        with contextlib.suppress(ConnectionResetError):
            assert (await reader.readline() == b"HTTP/1.1 200 OK\r\n") is answered


LISTS = [
    b"Accept-Encoding: " + b"a;q=1," * 600,
    b"Accept-Language: " + b"a-b;q=1," * 400,
    b"Connection: " + b"a," * 1500,
    b"If-None-Match: " + b'"a",' * 700,
    b"Range: bytes=" + b"1-2," * 700,
    b"\r\n".join([b"Accept-Encoding: " + b"gzip," * 100] * 5),
]


@pytest.mark.parametrize("lists", LISTS, ids=lambda lists: lists.partition(b":")[0].decode())
async def test_what_somebody_reads_word_by_word_is_short(port, lists):
    async with connected(port) as (reader, writer):
        writer.write(REQUEST % port + lists + b"\r\n\r\n")
        with contextlib.suppress(ConnectionResetError):
            assert await reader.read() == b""


def test_whatever_the_servers_read_of_a_head_counts():
    """`Authorization` is compared as a whole."""
    read = re.compile(r"headers\.get(?:list)?\(\"([\w-]+)\"")
    rooms = (SOURCES / room for room in ("chat/remote", "chat/serving", "recording"))
    files = (file.read_text("utf-8") for room in rooms for file in room.rglob("*.py"))
    names = {name.lower() for text in files for name in read.findall(text)}
    assert {"accept-language", "origin"} < names
    assert {name.encode() for name in names - {"authorization"}} <= prompt.PARSED


async def test_a_long_header_that_nobody_reads_is_borne(port):
    async with connected(port) as (reader, writer):
        long = b"X-Identity: " + b"a" * 20_000 + b"\r\nAuthorization: Bearer " + b"b" * 8000
        writer.write(REQUEST % port + long + b"\r\n\r\n")
        assert await reader.readline() == b"HTTP/1.1 200 OK\r\n"


@pytest.mark.parametrize("more, answered", [(0, True), (1, False)])
async def test_what_is_asked_for_is_short(port, more, answered):
    async with connected(port) as (reader, writer):
        asked = b"/health?" + b"a" * (prompt.LONGEST_TARGET - len(b"/health?") + more)
        writer.write(b"GET " + asked + HOST + b"\r\n")
        with contextlib.suppress(ConnectionResetError):
            assert (await reader.readline() == b"HTTP/1.1 200 OK\r\n") is answered


@pytest.mark.parametrize("name", [b"Protocol", b"Extensions"])
async def test_an_upgrade_costs_little_whatever_it_lists(port, name):
    async with connected(port) as (reader, writer):
        lists = (b"Sec-WebSocket-%s: " % name + b"a," * 4000 + b"a\r\n") * 7
        begun = time.process_time()
        writer.write(b"GET /echo" + HOST + UPGRADE + lists + b"\r\n")
        assert (await reader.readline()).startswith(b"HTTP/1.1 101")
        assert b"Sec-WebSocket-Protocol" not in await reader.readuntil(b"\r\n\r\n")
        assert time.process_time() - begun < 0.5


def test_no_head_that_is_taken_costs_the_libraries_much():
    """128 heads of one machine may come in one turn of the loop, and more of many."""
    words = {b"connection": b"a,", b"upgrade": b"a,", b"x-forwarded-for": b"a,", b"host": b"a."}
    for name, word in words.items():
        value = word * ((prompt.MOST_PARSED - 200) // len(word))
        head = b"GET /echo" + HOST + UPGRADE + name + b": " + value + b"a\r\n\r\n"
        times = []
        for _ in range(5):
            server, begun = ServerProtocol(), time.process_time()
            server.receive_data(head)
            for request in server.events_received():
                server.accept(request)
            times.append(time.process_time() - begun)
        assert min(times) < 0.01, name


async def test_a_header_behind_a_body_claims_nothing(unread):
    port, _ = unread
    async with connected(port) as (reader, writer):
        own, other = (b"X-Forwarded-For: 192.0.2.%d\r\n" % n for n in (1, 2))
        head = b"POST /name" + HOST + own + b"Transfer-Encoding: chunked\r\n\r\n"
        writer.write(head + b"1\r\nx\r\n0\r\n" + other + b"\r\n")
        answer = await reader.readuntil(b"]")
        assert answer.endswith(b'["192.0.2.1"]')


@pytest.mark.parametrize("trailer", [b"x" * 5000, b"a: b\r\n" * 50])
async def test_headers_behind_a_body_are_bounded_too(unread, trailer):
    port, _ = unread
    async with connected(port) as (reader, writer):
        writer.write(b"POST /length" + HOST + b"Transfer-Encoding: chunked\r\n\r\n0\r\nX-Long: ")
        closed = asyncio.create_task(seconds_until_closed(reader))
        for _ in range(20):
            writer.write(trailer)
            await asyncio.sleep(0.01)
        assert await closed < 2


@pytest.mark.parametrize("path", [b"/health", b"/length"], ids=["answered at once", "read"])
async def test_a_body_in_crumbs_is_cut_off_whether_it_is_read_or_not(port, unread, path):
    own, _ = unread
    async with connected(port if path == b"/health" else own) as (reader, writer):
        writer.write(b"POST " + path + HOST + b"Transfer-Encoding: chunked\r\n\r\n")
        closed = asyncio.create_task(seconds_until_closed(reader))
        with contextlib.suppress(ConnectionError):
            for _ in range(20):
                writer.write(b"1\r\nx\r\n" * 50)
                await writer.drain()
                await asyncio.sleep(0.01)
        assert await closed < 2


async def test_what_has_come_in_large_pieces_allows_no_more_crumbs(unread):
    port, _ = unread
    async with connected(port) as (reader, writer):
        writer.write(b"POST /length" + HOST + b"Transfer-Encoding: chunked\r\n\r\n")
        writer.write(b"%x\r\n%s\r\n" % (1 << 20, bytes(1 << 20)))
        closed = asyncio.create_task(seconds_until_closed(reader))
        with contextlib.suppress(ConnectionError):
            writer.write(b"1\r\nx\r\n" * 2 * prompt.PIECES)
            await writer.drain()
        assert await closed < 2


@pytest.mark.parametrize(("size", "count"), [(1, prompt.PIECES), (2 * prompt.SMALL, 600)])
async def test_some_small_pieces_or_many_of_good_size_are_no_crumbs(unread, size, count):
    port, _ = unread
    async with connected(port) as (reader, writer):
        writer.write(b"POST /length" + HOST + b"Transfer-Encoding: chunked\r\n\r\n")
        writer.write(b"%x\r\n%s\r\n" % (size, bytes(size)) * count + b"0\r\n\r\n")
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
        total = b"%d" % (size * count)
        assert await reader.readexactly(len(total)) == total


@pytest.mark.parametrize("coding", ["chunks", "a length"])
async def test_a_long_body_is_no_head(unread, coding):
    port, _ = unread
    body, size = bytes(1 << 18), 1 << 20
    async with connected(port) as (reader, writer):
        chunked = coding == "chunks"
        told = b"Transfer-Encoding: chunked" if chunked else b"Content-Length: %d" % size
        writer.write(b"POST /length" + HOST + told + b"\r\n\r\n")
        for _ in range(size // len(body)):
            writer.write(b"%x\r\n%s\r\n" % (len(body), body) if chunked else body)
            await writer.drain()
        writer.write(b"0\r\n\r\n" if chunked else b"")
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
        assert await reader.readexactly(7) == b"%d" % size


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
    monkeypatch.setattr(crowd, "machine_of", lambda client: client and "10.0.0.7")
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


async def test_who_connects_and_leaves_without_a_pause_is_turned_away(port, monkeypatch):
    arrivals = crowd.Meters(0.0, 5.0, lambda: 0.0)
    monkeypatch.setattr(prompt, "_arrivals", arrivals)
    monkeypatch.setattr(crowd, "machine_of", lambda client: client and "10.0.0.7")
    for _ in range(5):
        async with connected(port) as (reader, writer):
            writer.write(REQUEST % port + b"\r\n")
            assert (await reader.readline()).startswith(b"HTTP/1.1 200")
    async with connected(port) as (reader, _):
        assert await seconds_until_closed(reader) < 1
    assert arrivals.take("10.0.0.8")
    await until(lambda: prompt._open["10.0.0.7"] == 0)


def test_the_system_is_asked_for_connections(monkeypatch):
    given = []
    monkeypatch.setattr(prompt.resource, "getrlimit", lambda _: (1024, 524_288))
    monkeypatch.setattr(prompt.resource, "setrlimit", lambda _, limits: given.append(limits))
    prompt.allow_many_connections()
    monkeypatch.setattr(prompt.resource, "getrlimit", lambda _: (20_000, 20_000))
    prompt.allow_many_connections()
    assert given == [(65_536, 524_288)]
