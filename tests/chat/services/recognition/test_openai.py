"""Recognition by an OpenAI-compatible server: a real one in the test, that obeys or does not."""

import asyncio
import contextlib
import io
import time
import wave

import pytest
import uvicorn
from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse

from ico3d.chat.services.recognition.openai import Settings, hindrance, make
from ico3d.chat.services.recognition.segments import BLANK
from ico3d.chat.serving import server
from ico3d.errors import SettingsError
from support.chat.listening import NOBODY, listen, noise


def described(file, form, request):
    with wave.open(io.BytesIO(file)) as sound:
        seconds = sound.getnframes() / sound.getframerate()
        kind = f"{seconds:.1f} s, {sound.getframerate()} Hz, {sound.getnchannels()}"
    return f" {kind}; {form.get('language')}; {request.headers['authorization']} "


@contextlib.asynccontextmanager
async def transcribing():
    """Yields the URL of a server whose models behave as they are called, and who was called."""
    app, calls = FastAPI(), []

    @app.post("/v1/audio/transcriptions")
    async def transcribe(request: Request):
        form = await request.form()
        calls.append(form["model"])
        if form["model"] == "hanging":
            await asyncio.sleep(60)
        if form["model"] in ("500", "401"):
            return JSONResponse({"error": {"message": "sorry"}}, int(form["model"]))
        file = await form["file"].read()
        if form["model"] == "halves":
            return Response('{"text": "a\\ud83d."}', media_type="application/json")
        if form["model"].startswith("words"):
            return {"text": "word " * (int(form["model"][5:]) // 5)}
        return {"text": "" if form["model"] == "deaf" else described(file, form, request)}

    listener = server.bind("127.0.0.1", 0)
    config = uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=0)
    running = uvicorn.Server(config)
    task = asyncio.create_task(running.serve(sockets=[listener]))
    while not running.started:
        await asyncio.sleep(0.01)
    try:
        yield server.address(listener) + "v1", calls
    finally:
        running.should_exit = True
        await task


async def test_the_server_gets_what_was_said(monkeypatch):
    monkeypatch.setenv("MY_KEY", "secret")
    async with transcribing() as (url, calls):
        chosen = make(Settings(url, "any", "MY_KEY", "de"), NOBODY)
        frames, errors = await listen(chosen, noise(2.0))
        assert not errors
        assert [(frame.text, frame.finalized) for frame in frames] == [
            ("2.5 s, 16000 Hz, 1; de; Bearer secret", True)  # pipecat adds half a second of silence
        ]
        automatic = make(Settings(url, "any"), NOBODY)
        (frame,), _ = await listen(automatic, noise())
        assert frame.text == "1.5 s, 16000 Hz, 1; None; Bearer none"
        assert calls == ["any", "any"]


async def test_silence_is_a_blank_transcript():
    async with transcribing() as (url, _):
        (frame,), errors = await listen(make(Settings(url, "deaf"), NOBODY), noise())
        assert frame.text == BLANK and frame.finalized and not errors


async def test_halves_of_characters_go_no_further():
    async with transcribing() as (url, _):
        (frame,), errors = await listen(make(Settings(url, "halves"), NOBODY), noise())
        assert frame.text == "a\ufffd." and not errors


async def test_a_transcript_is_no_longer_than_a_question():
    async with transcribing() as (url, _):
        (frame,), errors = await listen(make(Settings(url, "words60000"), NOBODY), noise())
        assert frame.text == ("word " * 400).strip() and not errors


async def test_a_long_answer_is_not_even_parsed():
    async with transcribing() as (url, _):
        (frame,), errors = await listen(make(Settings(url, "words70000"), NOBODY), noise())
        assert frame.text == BLANK and len(errors) == 1 and "gave no transcript" in errors[0]


@pytest.mark.parametrize(
    ("model", "calls", "reason"),
    [("500", 2, "sorry"), ("401", 1, "sorry"), ("hanging", 1, "within 0.8 s.")],
)
async def test_a_failing_server_is_told_of_each_time(model, calls, reason):
    async with transcribing() as (url, called):
        service = make(Settings(url, model, timeout=0.8), NOBODY)
        started = time.monotonic()
        frames, errors = await listen(service, noise())
        assert time.monotonic() - started < 4
        assert len(errors) == 1 and url in errors[0] and reason in errors[0]
        assert [frame.text for frame in frames] == [BLANK]
        assert called == [model] * calls
        assert service.is_usable  # the next stretch is tried again


async def test_no_server_is_told_of():
    listener = server.bind("127.0.0.1", 0)  # not listening
    settings = Settings(server.address(listener) + "v1", timeout=5)
    frames, errors = await listen(make(settings, NOBODY), noise())
    assert "gave no transcript" in errors[0] and [frame.text for frame in frames] == [BLANK]
    assert hindrance(settings).startswith("no server answers at http://127.0.0.1:")
    listener.close()


async def test_it_is_never_chosen_by_itself():
    assert hindrance(Settings()) == (
        'no server is chosen: set [recognition] use = "openai" and url in a settings file '
        "(--settings FILE)."
    )
    with pytest.raises(SettingsError, match="url must be an address"):
        Settings("http://[")
    assert "no server answers at http://[" in hindrance(Settings("http://[::1]:9/v1"))
    async with transcribing() as (url, _):
        assert await asyncio.to_thread(hindrance, Settings(url)) == ""
