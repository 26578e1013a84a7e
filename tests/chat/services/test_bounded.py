"""What servers of services answer is bounded: its length, its parts, its pace, its calls."""

import asyncio
import contextlib
import gzip
import time

import pytest
from fastapi import FastAPI, Request, Response

from support.chat.scripted_server import running

httpx2 = pytest.importorskip("httpx2")
pytest.importorskip("openai")


JSON = {"Content-Type": "application/json"}


def answer(content, status: int = 200, path: str = "/chat/completions", body: bytes = b"{}"):
    """An answer to a request; it says nothing of what it is."""
    request = httpx2.Request("POST", f"http://127.0.0.1{path}", content=body, headers=JSON)

    async def sent():
        for piece in content:
            yield piece

    return httpx2.Response(status, content=sent(), request=request)


async def read(content, **about) -> bytes:
    """What is read of an answer of such pieces."""
    from ico3d.chat.services import bounded

    response = answer(content, **about)
    await bounded.bound(response)
    return await response.aread()


STREAM = b'{"model":"m","stream":true}'


@contextlib.asynccontextmanager
async def others():
    """A list of the turns that somebody else has meanwhile."""
    turns = []

    async def somebody():
        while True:
            await asyncio.sleep(0)
            turns.append(time.monotonic())

    task = asyncio.create_task(somebody())
    yield turns
    task.cancel()


async def test_answers_are_short_and_plain(monkeypatch):
    from ico3d.chat.services import bounded
    from ico3d.chat.services.client import client_options

    monkeypatch.setattr(bounded, "MOST_OF_EVENT", 1000)
    app, accepted = FastAPI(), []

    @app.get("/line/{size}")
    async def answer(size: int, request: Request) -> Response:
        accepted.append(request.headers["accept-encoding"])
        return Response(b"a" * size + b"\nend\n", media_type="application/json")

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


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
async def test_events_are_bounded_across_pieces_whatever_the_answer_calls_itself(monkeypatch, end):
    from ico3d.chat.services import bounded

    monkeypatch.setattr(bounded, "MOST_OF_EVENT", 100)
    event = b"data: " + b"a" * 90 + end
    both = [event[:60], event[60:] + end, event, end]
    assert await read(both, body=STREAM) == b"".join(both)
    for pieces in ([event, event], [event, end[:1] and b"data: b" + end], [b"a" * 60, b"a" * 41]):
        with pytest.raises(httpx2.ReadError, match="too large"):
            await read(pieces, body=STREAM)


async def test_a_line_end_of_two_characters_in_two_pieces_ends_no_event(monkeypatch):
    from ico3d.chat.services import bounded

    monkeypatch.setattr(bounded, "MOST_OF_EVENT", 100)
    with pytest.raises(httpx2.ReadError, match="too large"):
        await read([b"data: " + b"a" * 60 + b"\r", b"\ndata: " + b"a" * 60], body=STREAM)


@pytest.mark.parametrize("body", [b"{}", STREAM])
async def test_what_is_made_of_objects_has_few(body):
    """A line of 64 KiB, of 21,500 objects, held up everybody for 1.6 s."""
    from ico3d.chat.services import bounded

    fits = b"data: [" + b"{}," * (bounded.MOST_PARTS // 2 - 1) + b"]\n\n"
    assert await read([fits], body=body) == fits
    most = bounded.MOST_PARTS if body == STREAM else bounded.MOST_OF_WHOLE
    for many in (b"{}," * (most // 2 + 1), b"1," * (most + 1), b"[" * (most + 1)):
        with pytest.raises(httpx2.ReadError, match="too large"):
            await read([many], body=body)
    assert len(await read([b"{}," * 10_000], path="/v1/audio/speech")) == 30_000, "it is sound"


@pytest.mark.real_time
async def test_a_stream_comes_no_faster_than_others_can_bear(monkeypatch):
    from ico3d.chat.services import bounded

    monkeypatch.setattr(bounded, "PART_RATE", 1e5)
    event = b"data: {}\n\n"
    cost = bounded.cost_of(event)
    few, many = (round(share * bounded.PARTS_AT_ONCE / cost) for share in (0.9, 3.0))
    begun = time.monotonic()
    await read([event] * few, body=STREAM)
    at_once = time.monotonic() - begun
    async with others() as turns:
        await read([event] * many, body=STREAM)
    took = time.monotonic() - begun - at_once
    assert took > 0.9 * 2 * bounded.PARTS_AT_ONCE / 1e5 > at_once and len(turns) > 100


@pytest.mark.real_time
@pytest.mark.parametrize("about", [{"path": "/audio/speech"}, {"body": b"{}"}, {"body": STREAM}])
async def test_others_have_a_turn_while_pieces_of_a_byte_are_here(about):
    from ico3d.chat.services import bounded

    async with others() as turns:
        await read([b"a"] * 2000, **about)
    assert len(turns) >= 2000 // bounded.TURN - 1


async def test_no_cookies_are_kept():
    from ico3d.chat.services.client import client_options

    app, sent = FastAPI(), []

    @app.get("/")
    async def answer(request: Request) -> Response:
        sent.append(request.headers.get("cookie"))
        return Response(b"{}", headers={"Set-Cookie": "a=b; Path=/"})

    async with running(app) as port:
        url = f"http://127.0.0.1:{port}"
        client = client_options(url, "", "test")["http_client"]
        for _ in range(2):
            await client.get(url)
        await client.aclose()
    assert sent == [None, None]


async def test_a_large_piece_is_handed_on_in_slices():
    from ico3d.chat.services import bounded

    response = answer([b"data: {}\n\n" * 1000], body=STREAM)
    await bounded.bound(response)
    sizes = [len(piece) async for piece in response.aiter_raw()]
    assert sizes == [bounded.SLICE, bounded.SLICE, 10_000 - 2 * bounded.SLICE]


@pytest.mark.parametrize("kind", ["text/event-stream", "TEXT/Event-Stream"])
async def test_events_are_known_in_any_case(kind):
    from ico3d.chat.services.bounded import is_events

    assert is_events(httpx2.Response(200, headers={"Content-Type": kind}))


async def test_texts_are_utf_8_whatever_their_type_says():
    """Python takes the square of a text's length for the coding punycode."""
    from ico3d.chat.services import bounded

    said = "grüß dich"
    response = answer([said.encode()], status=500)
    response.headers["Content-Type"] = "text/plain; charset=punycode"
    await bounded.bound(response)
    await response.aread()
    assert response.text == said


@pytest.mark.parametrize("status", [302, 400, 503, 999])
async def test_errors_are_short(status):
    """The SDK makes objects of them, and a text of those; to it all is an error that is not 2xx."""
    from ico3d.chat.services import bounded

    half = b"a" * (bounded.MOST_OF_ERROR // 2)
    assert await read([half, half], status=status, path="/audio/speech") == 2 * half
    with pytest.raises(httpx2.ReadError, match="too large"):
        await read([half, half, b"a"], status=status, path="/audio/speech")


@pytest.mark.parametrize("long", ["name", "arguments", "id"])
async def test_calls_are_short(monkeypatch, long):
    from openai.types.chat import ChatCompletionChunk
    from pipecat.services.openai.llm import OpenAILLMService

    from ico3d.chat.services.language import compatible

    called = {"name": "", "arguments": ""}
    call = {"index": 0, "function": called, "id": ""}
    (call if long == "id" else called)[long] = "a" * 1000
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
    with pytest.raises(httpx2.ReadError, match="calls of functions are too long"):
        async for _ in await model.get_chat_completions(None):
            pass
    assert stream.closed and stream.sent == compatible.MOST_OF_CALLS // 1000 + 1


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
