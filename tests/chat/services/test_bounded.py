"""What servers of services answer is bounded: their lines, their length, their calls."""

import gzip

import pytest
from fastapi import FastAPI, Request, Response

from support.chat.scripted_server import running

httpx2 = pytest.importorskip("httpx2")
pytest.importorskip("openai")


async def test_answers_and_their_lines_are_short_and_plain(monkeypatch):
    from ico3d.chat.services import bounded
    from ico3d.chat.services.client import client_options

    monkeypatch.setattr(bounded, "MOST_BYTES", 1000)
    monkeypatch.setattr(bounded, "MOST_OF_LINE", 100)
    app, accepted = FastAPI(), []

    @app.get("/line/{size}")
    async def answer(size: int, request: Request, kind: str = "application/json") -> Response:
        accepted.append(request.headers["accept-encoding"])
        return Response(b"a" * size + b"\nend\n", media_type=kind)

    @app.get("/packed")
    async def packed() -> Response:
        return Response(gzip.compress(bytes(10**6)), headers={"Content-Encoding": "gzip"})

    async with running(app) as port:
        url = f"http://127.0.0.1:{port}"
        client = client_options(url, "", "test")["http_client"]
        assert len((await client.get(f"{url}/line/995")).content) == 1000
        with pytest.raises(httpx2.ReadError, match="too large"):
            await client.get(f"{url}/line/996")
        with pytest.raises(httpx2.ReadError, match="compressed"):
            await client.get(f"{url}/packed")
        await client.aclose()
    assert accepted == ["identity"] * 2


@pytest.mark.parametrize(
    ("pieces", "fits"),
    [([b"a" * 60, b"a" * 40, b"\n" + b"b" * 99], True), ([b"x\n", b"a" * 60, b"a" * 41], False)],
)
async def test_a_line_of_events_is_bounded_across_pieces(monkeypatch, pieces, fits):
    from ico3d.chat.services import bounded

    monkeypatch.setattr(bounded, "MOST_OF_LINE", 100)

    async def sent():
        for piece in pieces:
            yield piece

    response = httpx2.Response(200, headers={"Content-Type": bounded.EVENTS}, content=sent())
    await bounded.bound(response)
    if fits:
        assert await response.aread() == b"".join(pieces)
    else:
        with pytest.raises(httpx2.ReadError, match="too large"):
            await response.aread()


@pytest.mark.parametrize("kind", ["text/event-stream", "TEXT/Event-Stream"])
async def test_events_are_known_in_any_case(kind):
    from ico3d.chat.services.bounded import is_events

    assert is_events(httpx2.Response(200, headers={"Content-Type": kind}))


async def test_texts_are_utf_8_whatever_their_type_says():
    """Python takes the square of a text's length for the coding punycode."""
    from ico3d.chat.services import bounded

    said = "grüß dich"
    kind = {"Content-Type": "text/plain; charset=punycode"}
    response = httpx2.Response(500, headers=kind, content=said.encode())
    await bounded.bound(response)
    assert response.text == said


async def test_an_answer_calls_few_functions(monkeypatch):
    from pipecat.services.llm_service import FunctionCallFromLLM
    from pipecat.services.openai.llm import OpenAILLMService

    from ico3d.chat.services.language import compatible

    called = []

    async def run(self, calls):
        called.extend(calls)

    monkeypatch.setattr(OpenAILLMService, "run_function_calls", run)
    model = object.__new__(compatible.CompatibleModel)
    model._may_call = True
    calls = [FunctionCallFromLLM("mood", str(n), {"n": n}, None) for n in range(3000)]
    await model.run_function_calls(calls)
    assert called == calls[: compatible.MOST_CALLS]
