"""The voice of a server: a real one, over HTTP, that answers as it is told."""

import asyncio
import contextlib
import io
import struct
import tracemalloc
import wave

import numpy as np
import pytest
from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, StreamingResponse
from pipecat.frames.frames import TTSAudioRawFrame

from ico3d.chat.services.voice import openai, openai_service
from ico3d.chat.serving import server
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import ServiceError, SettingsError

TONE = 0.1  # radians per sample
PIECES = 5
PIECE = 3001  # bytes: samples are torn apart


def tone(samples):
    return (20_000 * np.sin(TONE * np.arange(samples))).astype("<i2")


def as_wav(pcm, rate):
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(rate)
        sound.writeframes(pcm.tobytes())
    return file.getvalue()


class Speech:
    """What the server does with a request."""

    def __init__(self):
        self.requests = []
        self.respond = None
        self.url = ""

    async def streamed(self, data, pause=0.0):
        for at in range(0, len(data), PIECE):
            yield data[at : at + PIECE]
            await asyncio.sleep(pause)


@pytest.fixture
async def speech():
    app, speech = FastAPI(), Speech()

    @app.post("/v1/audio/speech")
    async def create(request: Request):
        speech.requests.append((await request.json(), request.headers.get("authorization")))
        return await speech.respond()

    listener = server.bind("127.0.0.1", 0)
    running = server.make_server(app)
    task = asyncio.create_task(running.serve(sockets=[listener]))
    while not running.started:
        await asyncio.sleep(0.01)
    speech.url = server.address(listener) + "v1"
    yield speech
    running.should_exit = True
    await task


def voice(speech, **options):
    return openai.make(openai.Settings(speech.url, **options), None)


async def test_it_asks_as_the_settings_say(speech, say, monkeypatch):
    monkeypatch.setenv("MY_KEY", "secret")
    pcm = tone(9000)

    async def respond():
        return StreamingResponse(speech.streamed(pcm.tobytes()), media_type="audio/pcm")

    speech.respond = respond
    own = voice(speech, model="m", voice="any_name", key_variable="MY_KEY")
    heard, errors = await say(own, "Grüß dich, 你好!")
    assert not errors
    np.testing.assert_array_equal(heard, pcm)
    [(request, key)] = speech.requests
    assert key == "Bearer secret"
    assert request == {
        "input": "Grüß dich, 你好!",
        "model": "m",
        "voice": "any_name",
        "response_format": "pcm",
    }


@pytest.mark.parametrize("rate", [22050, 44100, 16000])
@pytest.mark.parametrize("header", [True, False])
async def test_sound_of_any_rate_becomes_24_khz_without_a_click(speech, say, rate, header):
    pcm = tone(7 * PIECE // 2)
    data = as_wav(pcm, rate) if header else pcm.tobytes()

    async def respond():
        kind = "audio/wav" if header else "audio/pcm"
        return StreamingResponse(speech.streamed(data, pause=0.05), media_type=kind)

    speech.respond = respond
    heard, errors = await say(voice(speech, rate=24000 if header else rate), "Hello", "again")
    assert not errors
    length = len(pcm) * SPEECH_RATE / rate
    assert len(heard) == pytest.approx(2 * length, abs=3)
    half = len(heard) // 2
    ideal = 20_000 * np.sin(TONE * rate / SPEECH_RATE * np.arange(half))
    for piece in (heard[:half], heard[len(heard) - half :]):
        np.testing.assert_allclose(piece[150:-150], ideal[150:-150], atol=300)


async def test_a_pause_of_the_server_makes_no_click(speech, say):
    pcm = tone(3 * 4800)

    async def respond():
        async def slowly():
            for part in np.split(pcm, 3):
                yield part.tobytes()
                await asyncio.sleep(0.3)

        return StreamingResponse(slowly(), media_type="audio/pcm")

    speech.respond = respond
    heard, errors = await say(voice(speech, rate=48000), "Hello")
    assert not errors and len(heard) == pytest.approx(7200, abs=2)
    ideal = 20_000 * np.sin(2 * TONE * np.arange(len(heard)))
    np.testing.assert_allclose(heard[150:-150], ideal[150:-150], atol=300)


async def test_the_first_sound_is_passed_on_before_the_last_is_made(speech, say):
    heard_first = asyncio.Event()
    waited = []

    async def respond():
        async def streamed():
            yield tone(5000).tobytes()
            await asyncio.wait_for(heard_first.wait(), 30)
            waited.append(True)
            yield tone(5000).tobytes()

        return StreamingResponse(streamed(), media_type="audio/pcm")

    speech.respond = respond
    own = voice(speech)
    push = own.push_frame

    async def pushed(frame, *rest):
        if isinstance(frame, TTSAudioRawFrame):
            heard_first.set()
        await push(frame, *rest)

    own.push_frame = pushed
    heard, errors = await say(own, "Hello")
    assert waited and not errors and len(heard) == 10_000


async def test_an_error_is_told_and_the_next_piece_is_spoken(speech, say):
    async def failing():
        return JSONResponse({"error": {"message": "no such voice"}}, 404)

    async def working():
        speech.respond = failing
        return StreamingResponse(speech.streamed(tone(4000).tobytes()), media_type="audio/pcm")

    speech.respond = working
    heard, errors = await say(voice(speech), "good", "bad")
    assert len(heard) == 4000
    assert "did not speak: " in errors[0] and "no such voice" in errors[0]


async def test_a_server_that_does_not_answer_is_given_up(speech, say):
    async def never():
        await asyncio.sleep(20)

    speech.respond = never
    began = asyncio.get_running_loop().time()
    with contextlib.suppress(asyncio.CancelledError):
        heard, errors = await say(voice(speech, timeout=0.3), "Hello")
    assert not len(heard) and "did not speak: " in errors[0]
    assert len(speech.requests) == 2  # one retry
    assert asyncio.get_running_loop().time() - began < 15


async def test_nobody_there_is_an_error(say):
    own = openai.make(openai.Settings("http://127.0.0.1:9/v1"), None)
    heard, errors = await say(own, "Hello")
    assert not len(heard) and "the voice server http://127.0.0.1:9/v1/ did not speak" in errors[0]


def test_settings_are_checked():
    with pytest.raises(SettingsError, match="rate must be 8000"):
        openai.Settings(rate=1)


async def test_an_interrupted_piece_leaves_no_trace_in_the_next(speech):
    pcm = tone(3 * PIECE)

    async def respond():
        return StreamingResponse(speech.streamed(pcm.tobytes()), media_type="audio/pcm")

    speech.respond = respond
    own = voice(speech, rate=48000)
    own._sample_rate = SPEECH_RATE  # as its pipeline would
    interrupted = own.run_tts("Hello", "1")
    assert isinstance(await anext(interrupted), TTSAudioRawFrame)
    await interrupted.aclose()
    heard = b"".join([frame.audio async for frame in own.run_tts("Hello", "2")])
    samples = np.frombuffer(heard, np.int16)
    assert len(samples) == pytest.approx(len(pcm) / 2, abs=2)
    ideal = 20_000 * np.sin(2 * TONE * np.arange(len(samples)))
    np.testing.assert_allclose(samples[150:-150], ideal[150:-150], atol=300)
    await own.cleanup()


@pytest.mark.parametrize(
    ("rate", "channels", "reason"),
    [(1, 1, "claims 1 samples per second"), (24_000, 2, "is not mono with 16 bits")],
)
async def test_a_header_that_claims_what_is_no_speech_is_an_error(
    speech, say, rate, channels, reason
):
    data = bytearray(as_wav(tone(2400), 24_000))
    struct.pack_into("<HI", data, 22, channels, rate)

    async def respond():
        return StreamingResponse(speech.streamed(bytes(data)), media_type="audio/wav")

    speech.respond = respond
    tracemalloc.start()
    heard, errors = await say(voice(speech), "Hello")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert not len(heard) and reason in errors[0] and peak < 30_000_000


@pytest.mark.parametrize(
    ("before", "form", "reason"),
    [(b"", b"LIES", "no plain WAV header"), (bytes(64), b"WAVE", "claims 10 samples per second")],
)
async def test_a_header_is_read_wherever_the_pipeline_would(before, form, reason):
    header = bytearray(as_wav(tone(2400), 24_000))
    header[8:12], header[24:28] = form, struct.pack("<I", 10)

    async def pieces():
        if before:
            yield before
        yield bytes(header)

    with pytest.raises(ServiceError, match=reason):
        [piece async for piece in openai_service.judged(pieces(), SPEECH_RATE)]


async def test_a_voice_that_does_not_end_is_ended(speech, say, monkeypatch):
    monkeypatch.setattr(openai_service, "REQUEST", 2.0)

    async def respond():
        data = bytes(10 * 2 * SPEECH_RATE)  # more than it takes
        return StreamingResponse(speech.streamed(data), media_type="audio/pcm")

    speech.respond = respond
    heard, errors = await say(voice(speech), "Hello")
    assert len(heard) <= 2 * SPEECH_RATE and "is longer than 2 s" in errors[0]
