"""Answers of MCP servers that would fill the memory are cut."""

import asyncio
import gzip
import json
import time

import pytest
from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse

from ico3d.chat.services.bounded import Limits
from ico3d.chat.settings.mcp import McpServer
from ico3d.chat.tools.mcp import Connection
from support.chat.scripted_server import running
from support.chat.waiting import until

httpx2 = pytest.importorskip("httpx2")
NO_METHOD = {"code": -32601, "message": "no such method"}


async def test_answers_are_short_and_plain(monkeypatch):
    from ico3d.chat.services.bounded import EVENTS
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "MESSAGE", Limits(1000, 10))
    app, accepted = FastAPI(), []

    @app.get("/{size}")
    async def answer(size: int, request: Request, kind: str = "application/json") -> Response:
        accepted.append(request.headers["accept-encoding"])
        return Response(
            (b" " * 499 + b"\n\n") * (size // 501) + b" " * (size % 501), media_type=kind
        )

    @app.get("/parts/{number}")
    async def parts(number: int, request: Request, kind: str = "application/json") -> Response:
        accepted.append(request.headers["accept-encoding"])
        return Response(b"{}," * number, media_type=kind)

    @app.post("/")
    async def packed() -> Response:
        return Response(gzip.compress(bytes(10**6)), headers={"Content-Encoding": "gzip"})

    transport = bounded_http.BoundedTransport(2.0, trust_env=False)
    async with running(app) as port, httpx2.AsyncClient(transport=transport) as client:
        url = f"http://127.0.0.1:{port}"
        assert len((await client.get(f"{url}/1000")).content) == 1000
        assert len((await client.get(f"{url}/2000?kind={EVENTS}")).content) == 2000
        with pytest.raises(httpx2.ReadError, match="too large"):
            await client.get(f"{url}/1001")
        for kind in ("application/json", EVENTS):
            assert (await client.get(f"{url}/parts/5?kind={kind}")).content == b"{}," * 5
            with pytest.raises(httpx2.ReadError, match="too large"):
                await client.get(f"{url}/parts/6?kind={kind}")
        with pytest.raises(httpx2.ReadError, match="compressed"):
            await client.post(url)
    assert accepted == ["identity"] * 7


@pytest.fixture
async def answered(monkeypatch):
    """Opens what a server answers in pieces, of a type, as the SDK does."""
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "LINES_AT_ONCE", 80.0)

    async def events(pieces, kind="text/event-stream"):
        async def sent():
            for piece in pieces:
                yield piece

        async def answer(self, request):
            return httpx2.Response(200, headers={"Content-Type": kind}, content=sent())

        monkeypatch.setattr(httpx2.AsyncHTTPTransport, "handle_async_request", answer)
        transport = bounded_http.BoundedTransport(2.0, trust_env=False)
        async with (
            httpx2.AsyncClient(transport=transport) as client,
            client.stream("GET", "http://127.0.0.1/") as response,
        ):
            return [event async for event in httpx2.EventSource(response)]

    return events


EVENT = b"id: 1\nevent: message\ndata: {}\n\n"


@pytest.mark.parametrize(
    "pieces",
    [
        [EVENT * 20],
        [EVENT[:8], EVENT[8:]] * 20,
        [bytes([one]) for one in EVENT * 20],
        [bytes([one]) for one in EVENT.replace(b"\n", b"\r\n") * 20],
        [EVENT.replace(b"\n", b"\r") * 20],
    ],
)
@pytest.mark.parametrize("kind", ["text/event-stream", "Text/Event-Stream; charset=utf-8"])
async def test_events_come_no_faster_than_visitors_can_bear(answered, pieces, kind):
    assert len(await answered(pieces, kind)) == 20
    with pytest.raises(httpx2.ReadError, match="too many events"):
        await answered(pieces * 2, kind)


@pytest.mark.parametrize(
    "pieces", [[b"id:1\n\n"] * 80, [b"retry:1\r\r" * 80], [b": ping\n"] * 160, [b":", b"\n"] * 160]
)
async def test_events_without_data_count(answered, pieces):
    with pytest.raises(httpx2.ReadError, match="too many events"):
        await answered(pieces)


@pytest.mark.parametrize("coding", ["unicode_escape", "utf-7", "punycode"])
async def test_events_are_utf_8_whatever_their_type_says(answered, coding):
    hidden = (b"id:1\\n\\n", b"id:1+AAoACg-", b"id:1")
    assert await answered(hidden * 100, f"text/event-stream; charset={coding}") == []


@pytest.mark.parametrize("method", ["GET", "POST"])
@pytest.mark.parametrize("status", [307, 404, 500])
async def test_what_is_no_success_is_no_stream_of_events(monkeypatch, method, status):
    """A redirect's body is kept whole by who follows it, however long it goes on."""
    from ico3d.chat.services.bounded import EVENTS
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "MESSAGE", Limits(1000, 10))

    async def sent():
        for _ in range(100):
            yield b":" * 100

    async def answer(self, request):
        headers = {"Content-Type": EVENTS, "Location": "/again"}
        return httpx2.Response(status, headers=headers, content=sent())

    monkeypatch.setattr(httpx2.AsyncHTTPTransport, "handle_async_request", answer)
    transport = bounded_http.BoundedTransport(2.0, trust_env=False)
    async with httpx2.AsyncClient(transport=transport, follow_redirects=True) as client:
        with pytest.raises(httpx2.ReadError, match="too large"):
            await client.request(method, "http://127.0.0.1/")


def _hasty(is_resumed):
    """An MCP server whose streams end at once and are to be opened again at once, without end.

    Args:
        is_resumed: Whether it is the answer to a call that is resumed so, else the one stream that
            each client opens.

    Returns:
        It, and the methods of the requests that come.
    """
    app, methods = FastAPI(), []
    again = Response(b"id: 1\nretry: 0\ndata:\n\n", media_type="text/event-stream")

    @app.post("/mcp")
    async def call(request: Request) -> Response:
        message = await request.json()
        asked = message.get("method")
        methods.append(asked)
        if asked == "tools/list" and is_resumed:
            return again
        results = {
            "initialize": {
                "protocolVersion": message.get("params", {}).get("protocolVersion"),
                "capabilities": {"tools": {}},
                "serverInfo": {"name": "hasty", "version": "1"},
            },
            "tools/list": {"tools": [{"name": "t", "inputSchema": {"type": "object"}}]},
        }
        if "id" not in message:
            return Response(status_code=202)
        told = {"result": results[asked]} if asked in results else {"error": NO_METHOD}
        answer = {"jsonrpc": "2.0", "id": message["id"], **told}
        return JSONResponse(answer, headers={"mcp-session-id": "s"})

    @app.get("/mcp")
    async def stream(request: Request) -> Response:
        methods.append("GET")
        is_first = "last-event-id" not in request.headers
        return Response(status_code=405) if is_resumed and is_first else again

    return app, methods


@pytest.mark.real_time
@pytest.mark.parametrize("is_resumed", [False, True])
async def test_streams_are_not_opened_again_without_a_pause(monkeypatch, is_resumed):
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "STREAMS_AT_ONCE", 3.0)
    app, methods = _hasty(is_resumed)
    async with running(app) as port:
        connection = Connection(McpServer("m", url=f"http://127.0.0.1:{port}/mcp", seconds=2))
        asked = asyncio.create_task(connection.functions())
        await until(lambda: methods.count("GET") >= 3, 60)  # the first imports the SDK
        await asyncio.sleep(2.5)
        assert methods.count("GET") <= 3 + 4
        if is_resumed:
            with pytest.raises(TimeoutError):
                await asked
        else:
            assert [one.name for one in await asked] == ["m_t"]
        before = len(methods)
        assert "error" in await connection.call("t", {})  # at once, whatever waits
        assert "tools/call" in methods[before:]
        await connection.close()


async def test_no_more_than_a_few_streams_wait_to_be_opened(monkeypatch):
    """Calls that were answered on another stream resumed their own while a visitor stayed."""
    from ico3d.chat.tools import bounded_http

    async def answer(transport, request):
        return httpx2.Response(200)

    monkeypatch.setattr(bounded_http, "STREAMS_AT_ONCE", 1.0)
    monkeypatch.setattr(httpx2.AsyncHTTPTransport, "handle_async_request", answer)
    transport = bounded_http.BoundedTransport(2.0, trust_env=False)
    async with httpx2.AsyncClient(transport=transport) as client:
        opened = [asyncio.create_task(client.get("http://127.0.0.1/")) for _ in range(40)]
        refused = await asyncio.wait_for(asyncio.gather(*opened[11:], return_exceptions=True), 5)
        assert {str(error) for error in refused} == {"it ends too many streams"}
        assert (await opened[0]).is_success
        for waiting in opened[1:11]:
            waiting.cancel()
        await asyncio.wait(opened)
        assert transport._waiting == 0


@pytest.mark.real_time
async def test_a_server_that_does_not_let_go_keeps_nobody(monkeypatch):
    """Visits left connections behind, the server no longer ended, and a call had no end."""
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "ENDING", 0.3)
    app, methods = _hasty(is_resumed=False)
    held = asyncio.Event()

    @app.delete("/mcp")
    async def end() -> Response:
        methods.append("DELETE")
        await held.wait()
        return Response()

    async with running(app) as port:
        connection = Connection(McpServer("m", url=f"http://127.0.0.1:{port}/mcp", seconds=2))
        assert [one.name for one in await connection.functions()] == ["m_t"]
        async with asyncio.timeout(3):
            await connection.close()
        held.set()
    assert methods.count("DELETE") == 1


@pytest.mark.real_time
async def test_a_lost_call_ends_though_its_session_does_not(monkeypatch):
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "ENDING", 0.3)
    app, _ = _hasty(is_resumed=False)
    held, lost = asyncio.Event(), False

    @app.middleware("http")
    async def lose(request: Request, go_on):
        if lost and request.method == "POST":
            return Response(status_code=404)
        if request.method == "DELETE":
            await held.wait()
        return await go_on(request)

    async with running(app) as port:
        connection = Connection(McpServer("m", url=f"http://127.0.0.1:{port}/mcp", seconds=2))
        await connection.functions()
        lost = True
        async with asyncio.timeout(4):
            assert "t failed" in (await connection.call("t", {}))["error"]
        held.set()


@pytest.mark.real_time
async def test_an_answer_of_nothing_but_faults_is_refused_before_they_are_told():
    """Of 300 kB the SDK made errors for 5 s, and 1.9 GB of them."""
    app, _ = _hasty(is_resumed=False)
    faults = b'{"jsonrpc":"2.0","id":%d,"result":{"content":[' + b"{}," * 100_000 + b"{}]}}"

    @app.middleware("http")
    async def fault(request: Request, go_on):
        body = await request.body()
        if b"tools/call" not in body:
            return await go_on(request)
        return Response(faults % json.loads(body)["id"], media_type="application/json")

    async with running(app) as port:
        connection = Connection(McpServer("m", url=f"http://127.0.0.1:{port}/mcp", seconds=5))
        await connection.functions()
        begun = time.process_time()
        assert "t failed" in (await connection.call("t", {}))["error"]
        assert time.process_time() - begun < 1.0
        await connection.close()
