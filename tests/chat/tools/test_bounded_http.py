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


async def test_events_come_no_faster_than_visitors_can_bear(monkeypatch):
    from ico3d.chat.services.bounded import EVENTS
    from ico3d.chat.tools import bounded_http

    monkeypatch.setattr(bounded_http, "EVENTS_AT_ONCE", 20.0)
    app = FastAPI()

    @app.get("/{count}")
    async def events(count: int) -> Response:
        return Response(b"event: message\ndata: {}\n\n" * count, media_type=EVENTS)

    transport = bounded_http.BoundedTransport(trust_env=False)
    async with running(app) as port, httpx2.AsyncClient(transport=transport) as client:
        url = f"http://127.0.0.1:{port}"
        assert (await client.get(f"{url}/20")).content.count(b"data:") == 20
        with pytest.raises(httpx2.ReadError, match="too many events"):
            await client.get(f"{url}/21")
