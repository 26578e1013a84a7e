"""Answers of MCP servers that would fill the memory are cut."""

import gzip

import pytest
from fastapi import FastAPI, Request, Response

from support.chat.scripted_server import running

httpx2 = pytest.importorskip("httpx2")


async def test_answers_are_short_and_plain(monkeypatch):
    from ico3d.chat.services.bounded import EVENTS
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "MOST_BYTES", 1000)
    app, accepted = FastAPI(), []

    @app.get("/{size}")
    async def answer(size: int, request: Request, kind: str = "application/json") -> Response:
        accepted.append(request.headers["accept-encoding"])
        return Response(b" " * size, media_type=kind)

    @app.post("/")
    async def packed() -> Response:
        return Response(gzip.compress(bytes(10**6)), headers={"Content-Encoding": "gzip"})

    transport = bounded_http.BoundedTransport(trust_env=False)
    async with running(app) as port, httpx2.AsyncClient(transport=transport) as client:
        url = f"http://127.0.0.1:{port}"
        assert len((await client.get(f"{url}/1000")).content) == 1000
        assert len((await client.get(f"{url}/2000?kind={EVENTS}")).content) == 2000
        with pytest.raises(httpx2.ReadError, match="more than 1000 bytes"):
            await client.get(f"{url}/1001")
        with pytest.raises(httpx2.ReadError, match="compressed"):
            await client.post(url)
    assert accepted == ["identity"] * 3


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
        transport = bounded_http.BoundedTransport(trust_env=False)
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
