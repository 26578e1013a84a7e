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


@pytest.mark.parametrize("status", [200, 400, 503])
async def test_errors_are_short(status):
    """The SDK makes objects of them, and a text of those."""
    from ico3d.chat.services import bounded

    async def sent():
        for _ in range(2):
            yield b"a" * (bounded.MOST_OF_ERROR // 2 + 1)

    response = httpx2.Response(status, content=sent())
    await bounded.bound(response)
    if status == 200:
        assert len(await response.aread()) > bounded.MOST_OF_ERROR
    else:
        with pytest.raises(httpx2.ReadError, match="too large"):
            await response.aread()


async def test_a_call_has_short_arguments(monkeypatch):
    from openai.types.chat import ChatCompletionChunk
    from pipecat.services.openai.llm import OpenAILLMService

    from ico3d.chat.services.language import compatible

    call = {"index": 0, "function": {"name": "mood", "arguments": "a" * 1000}}
    choice = {"index": 0, "delta": {"tool_calls": [call]}}
    about = {"id": "", "created": 0, "model": "", "object": "chat.completion.chunk"}
    piece = ChatCompletionChunk.model_validate({**about, "choices": [choice]})

    class Stream:
        closed, sent = False, 0

        async def __aiter__(self):
            for _ in range(10_000):
                self.sent += 1
                yield piece

        async def close(self):
            self.closed = True

    async def answered(self, context):
        return stream

    stream = Stream()
    monkeypatch.setattr(OpenAILLMService, "get_chat_completions", answered)
    model = object.__new__(compatible.CompatibleModel)
    model._place = ("nowhere", "test")
    with pytest.raises(httpx2.ReadError, match="arguments of its functions are too long"):
        async for _ in await model.get_chat_completions(None):
            pass
    assert stream.closed and stream.sent == compatible.MOST_ARGUMENTS // 1000 + 1


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
