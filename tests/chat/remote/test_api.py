"""The OpenAI SDK talks to our modules, which are the real offline three over real HTTP."""

import asyncio
import codecs
import contextlib
import io
import json
import socket
import wave

import httpx
import numpy as np
import openai
import pytest
from pipecat.frames.frames import (
    AggregatedTextFrame,
    ErrorFrame,
    LLMContextFrame,
    LLMTextFrame,
    TTSAudioRawFrame,
)
from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.remote import door
from ico3d.chat.remote.headless import Spares
from ico3d.chat.remote.limits import Limits
from ico3d.chat.remote.recognition import read_wav
from ico3d.chat.remote.voice import spoken
from ico3d.chat.services.voice import espeak, lasting
from ico3d.errors import ProtocolError
from support.chat.remote import (
    make_language,
    make_recognition,
    make_voice,
    service_app,
    serving,
)
from support.chat.serving import visiting
from support.chat.waiting import until

pytestmark = pytest.mark.slow

TEXT = "I am Ada. I live in a box."


def client(url, **more):
    return openai.AsyncOpenAI(base_url=f"{url}v1", api_key="none", max_retries=0, **more)


def wav(pcm, rate=16_000, channels=1, width=2):
    file = io.BytesIO()
    with wave.open(file, "wb") as out:
        out.setnchannels(channels)
        out.setsampwidth(width)
        out.setframerate(rate)
        out.writeframes(pcm.tobytes())
    return file.getvalue()


async def test_the_sdk_hears_our_voice():
    async with serving(service_app("voice", make_voice)) as url:
        sdk, ask = client(url), {"model": "any", "voice": "alloy", "input": TEXT}
        async with sdk.audio.speech.with_streaming_response.create(
            **ask, response_format="pcm"
        ) as response:
            pieces = [piece async for piece in response.iter_bytes()]
        pcm = np.frombuffer(b"".join(pieces), np.int16)
        local = [espeak.spoken(s, "en-us+f3", 165) for s in ("I am Ada.", "I live in a box.")]
        np.testing.assert_array_equal(pcm, np.concatenate(local))
        answer = await sdk.audio.speech.create(**ask, response_format="wav")
        with wave.open(io.BytesIO(answer.content)) as file:
            assert (file.getframerate(), file.getnchannels(), file.getsampwidth()) == (24_000, 1, 2)
            assert file.readframes(10**7) == pcm.tobytes()
        with pytest.raises(openai.BadRequestError, match="response_format"):
            await sdk.audio.speech.create(**ask, response_format="mp3")
        assert [model.id async for model in sdk.models.list()] == ["voice"]


async def test_the_sdk_converses_with_our_language():
    async with serving(service_app("language", make_language)) as url:
        sdk = client(url)
        messages = [
            {"role": "system", "content": "Be."},
            {"role": "user", "content": "who are you"},
        ]
        whole = await sdk.chat.completions.create(model="any", messages=messages)
        assert whole.choices[0].message.content.strip() == "I am Ada. I live in a box. Grüße, 你好!"
        assert whole.choices[0].finish_reason == "stop"
        stream = await sdk.chat.completions.create(model="any", messages=messages, stream=True)
        deltas = [chunk.choices[0].delta.content async for chunk in stream]
        assert deltas == ["I am Ada. ", "I live in a box. ", "Grüße, 你好! ", None]
        with pytest.raises(openai.BadRequestError, match="messages"):
            await sdk.chat.completions.create(model="any", messages=[])


async def test_the_sdk_is_understood_by_our_recognition(question):
    async with serving(service_app("recognition", make_recognition)) as url:
        sdk, file = client(url), ("q.wav", wav(question), "audio/wav")
        create = sdk.audio.transcriptions.create
        assert await create(model="any", file=file, response_format="text") == "what is your name\n"
        verbose = await create(model="any", file=file, response_format="verbose_json")
        assert verbose.text == "what is your name"
        assert verbose.duration == pytest.approx(len(question) / 16_000)
        silence = ("q.wav", wav(np.zeros(8000, np.int16)), "audio/wav")
        assert (await create(model="any", file=silence)).text == ""
        with pytest.raises(openai.BadRequestError, match="no WAV file"):
            await create(model="any", file=("q.mp3", b"ID3 garbage" * 99, "audio/mpeg"))


@pytest.mark.parametrize(
    ("rate", "channels", "width"), [(16_000, 1, 2), (48_000, 2, 2), (8000, 1, 4)]
)
def test_wav_files_of_any_kind_are_read(rate, channels, width):
    times = np.arange(rate) / rate
    tone = 0.5 * np.sin(2 * np.pi * 300 * times)
    samples = np.repeat((tone * (2 ** (8 * width - 1) - 1))[:, None], channels, axis=1)
    pcm = read_wav(io.BytesIO(wav(samples.astype(f"<i{width}"), rate, channels, width)))
    expected = 0.5 * np.sin(2 * np.pi * 300 * np.arange(16_000) / 16_000) * 32767
    assert len(pcm) == 16_000
    assert np.abs(pcm[400:-400] - expected[400:-400]).max() < 40


@pytest.mark.parametrize("data", [b"", b"RIFF", wav(np.zeros(0, np.int16)), b"RIFF" + b"x" * 99])
def test_what_is_no_sound_is_one_sentence(data):
    with pytest.raises(ProtocolError, match=r"WAV file"):
        read_wav(io.BytesIO(data))


async def test_a_door_with_a_key_and_limits():
    app = service_app("voice", make_voice, Limits(megabytes=0.001), key="sesame")
    async with serving(app) as url, visiting(url) as plain:
        assert (await plain.get("/health")).json() == {
            "ok": True,
            "kind": "voice",
            "model": "voice",
        }
        assert (await plain.get("/v1/models")).status_code == 401
        with pytest.raises(openai.AuthenticationError, match="key is missing or wrong"):
            await client(url).models.list()
        sdk = openai.AsyncOpenAI(base_url=f"{url}v1", api_key="sesame", max_retries=0)
        assert (await sdk.models.list()).data[0].owned_by == "ico3d"
        with pytest.raises(openai.APIStatusError, match="larger than") as refused:
            await sdk.audio.speech.create(model="a", voice="a", input="a" * 2000)
        assert refused.value.status_code == 413
        key = {"Authorization": "Bearer sesame"}
        for foreign in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}):
            assert (await plain.get("/v1/models", headers=key | foreign)).status_code == 403


async def endless():
    """A body that tells no length."""
    for _ in range(100):
        yield b'{"input": "' + b"a" * 1000


async def test_a_body_without_a_length_is_limited_too():
    app = service_app("voice", make_voice, Limits(megabytes=0.01))
    async with serving(app) as url, visiting(url) as plain:
        kind = {"Content-Type": "application/json"}
        answer = await plain.post("/v1/audio/speech", content=endless(), headers=kind)
        assert answer.status_code == 413
        assert (await plain.get("/health")).is_success


class Odd(FrameProcessor):
    """A language model that goes wrong in some way."""

    def __init__(self, way):
        super().__init__()
        self.way = way

    async def process_frame(self, frame, direction):
        await super().process_frame(frame, direction)
        if not isinstance(frame, LLMContextFrame):
            await self.push_frame(frame, direction)
        elif self.way == "error":
            await self.push_error_frame(ErrorFrame("its tongue is tied."))
        elif self.way == "raise":
            raise RuntimeError("oops")
        elif self.way == "hang":
            await asyncio.sleep(60)
        elif self.way == "half":
            await self.push_frame(LLMTextFrame("Half"))
            await asyncio.sleep(0.2)
            await self.push_error_frame(ErrorFrame("its tongue is tied."))


@pytest.mark.parametrize(
    ("way", "status", "sentence"),
    [
        ("error", 502, "its tongue is tied."),
        ("raise", 502, "Error processing frame: oops"),
        ("silence", 502, "the model gave no answer."),
        ("hang", 504, "it took too long."),
    ],
)
async def test_what_goes_wrong_inside_is_an_answer(way, status, sentence):
    app = service_app("language", lambda: Odd(way), Limits(seconds=0.5 if status == 504 else 20))
    async with serving(app) as url, visiting(url) as plain:
        body = {"model": "any", "messages": [{"role": "user", "content": "hi"}]}
        for stream in (False, True):
            answer = await plain.post("/v1/chat/completions", json=body | {"stream": stream})
            assert (answer.status_code, answer.json()["error"]["message"]) == (status, sentence)


async def test_a_stream_that_breaks_is_not_taken_for_whole():
    async with serving(service_app("language", lambda: Odd("half"))) as url:
        stream = await client(url).chat.completions.create(
            model="any", messages=[{"role": "user", "content": "hi"}], stream=True
        )
        heard = []
        with pytest.raises(openai.APIConnectionError):
            async for chunk in stream:
                heard.append(chunk.choices[0].delta.content)
        assert heard == ["Half"]


async def test_more_requests_than_allowed_are_told_to_wait():
    made = []

    def hanging():
        made.append(Odd("hang"))
        return made[-1]

    app = service_app("language", hanging, Limits(requests=1, seconds=2.0))
    async with serving(app) as url, visiting(url) as plain:
        body = {"model": "any", "messages": [{"role": "user", "content": "hi"}]}
        before = len(made)
        first = asyncio.create_task(plain.post("/v1/chat/completions", json=body))
        await until(lambda: len(made) > before)
        second = await plain.post("/v1/chat/completions", json=body)
        assert second.status_code == 429 and second.headers["retry-after"] == "1"
        assert (await first).status_code == 504
        assert json.loads((await plain.get("/health")).text)["ok"]


async def taken(plain):
    """Waits until the only place is taken."""
    async with asyncio.timeout(30):
        while (await plain.get("/v1/models")).status_code != 429:
            await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def begun(url):
    """A request of which only the beginning has come."""
    address = httpx.URL(url)
    reader, writer = await asyncio.open_connection(address.host, address.port)
    head = "POST /v1/chat/completions HTTP/1.1", f"Host: {address.netloc.decode()}"
    kind = "Content-Type: application/json", "Content-Length: 1000"
    writer.write("\r\n".join((*head, *kind, "", "{")).encode())
    yield reader, writer
    writer.close()


async def test_a_request_that_never_comes_gives_its_place_back(monkeypatch):
    monkeypatch.setattr(door, "SILENCE", 2.0)
    ask = {"messages": [{"role": "user", "content": "who are you"}]}
    app = service_app("language", make_language, Limits(requests=1))
    async with serving(app) as url, begun(url) as (reader, _), visiting(url) as http:
        await taken(http)
        assert (await http.post("v1/chat/completions", json=ask)).status_code == 429
        assert b" 400 " in await asyncio.wait_for(reader.readline(), 5)
        assert (await http.post("v1/chat/completions", json=ask)).status_code == 200


async def test_a_request_that_drips_gives_its_place_back(monkeypatch):
    """A byte now and then is no reason to go on waiting."""
    monkeypatch.setattr(door, "SILENCE", 0.5)
    app = service_app("language", make_language, Limits(requests=1))
    async with serving(app) as url, begun(url) as (reader, writer):

        async def drip():
            while True:
                await asyncio.sleep(0.1)
                writer.write(b" ")

        dripping = asyncio.create_task(drip())
        assert b" 400 " in await asyncio.wait_for(reader.readline(), 5)
        dripping.cancel()


async def test_an_answer_that_nobody_reads_gives_its_place_back(monkeypatch):
    monkeypatch.setattr(door, "SILENCE", 2.0)
    body = json.dumps({"input": "One two three four five six seven. " * 116}).encode()  # 9 MB
    async with serving(service_app("voice", make_voice, Limits(requests=1))) as url:
        address = httpx.URL(url)
        with socket.socket() as silent:
            silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            silent.setblocking(False)
            await asyncio.get_running_loop().sock_connect(silent, (address.host, address.port))
            head = "POST /v1/audio/speech HTTP/1.1", f"Host: {address.netloc.decode()}"
            kind = "Content-Type: application/json", f"Content-Length: {len(body)}"
            silent.send("\r\n".join((*head, *kind, "", "")).encode() + body)
            async with visiting(url) as http, asyncio.timeout(60):
                await taken(http)
                while (await http.get("v1/models")).status_code == 429:
                    await asyncio.sleep(0.2)


@pytest.mark.parametrize(
    ("method", "path", "kind", "body", "status"),
    [
        ("POST", "chat/completions", "application/json", b'{"a": ', 400),
        ("POST", "chat/completions", "application/json", b"\xff\xfe{", 400),
        ("POST", "chat/completions", "application/json", b"[" * 100_000, 400),
        ("POST", "audio/transcriptions", "multipart/form-data; boundary=x", b"--y\r\n", 400),
        ("POST", "audio/transcriptions", "multipart/form-data", b"x", 400),
        ("GET", "chat/completions", "application/json", b"", 405),
        ("POST", "nothing", "application/json", b"{}", 404),
    ],
)
async def test_whatever_is_wrong_is_told_in_the_form_of_the_api(method, path, kind, body, status):
    served = "recognition" if path.startswith("audio") else "language"
    make = make_recognition if served == "recognition" else make_language
    async with serving(service_app(served, make)) as url, visiting(url) as http:
        headers = {"Content-Type": kind}
        answer = await http.request(method, f"v1/{path}", content=body, headers=headers)
    assert answer.status_code == status
    told = answer.json()["error"]
    assert told["message"].endswith(".") and told["type"] == "invalid_request_error"


async def test_a_voice_without_end_is_ended(monkeypatch):
    monkeypatch.setattr(lasting, "LEAST", 1.0)
    monkeypatch.setattr(lasting, "LETTER", 0.0)
    asked = {"input": "This sentence takes two seconds, or a little more than that, to say."}
    async with serving(service_app("voice", make_voice)) as url, visiting(url) as http:
        answer = await http.post("v1/audio/speech", json=asked)
    assert answer.status_code == 502
    assert answer.json()["error"]["message"] == "its sound is much longer than the text."


class Repeating(FrameProcessor):
    """A voice that notes what it is to say at a time, and says a sample of it."""

    def __init__(self, said):
        super().__init__()
        self._said = said

    async def process_frame(self, frame, direction):
        await super().process_frame(frame, direction)
        assert not isinstance(frame, LLMTextFrame)  # a voice would look for its sentences itself
        if isinstance(frame, AggregatedTextFrame):
            self._said.append(frame.text)
            await self.push_frame(TTSAudioRawFrame(b"ab", 24_000, 1))
        await self.push_frame(frame, direction)


async def test_a_voice_gets_a_long_text_in_sentences_which_have_an_end():
    said = []
    voices = Spares(lambda: Repeating(said))
    text = f"{TEXT} " + "A." * 2000
    sound = [pcm async for pcm in spoken(text, voices, 20)]
    assert b"".join(sound) == b"ab" * len(said)
    assert said[:2] == ["I am Ada.", "I live in a box."] and max(map(len, said)) <= 401
    assert "".join(said[2:]) == "A." * 2000


async def test_a_request_of_thousands_of_tools_or_messages_is_refused():
    said, tool = {"role": "user", "content": "hi"}, {"function": {"name": "a"}}
    async with (
        serving(service_app("language", make_language)) as url,
        visiting(url) as http,
    ):
        for ask in ({"messages": [said], "tools": [tool] * 129}, {"messages": [said] * 10_001}):
            answer = await http.post("v1/chat/completions", json=ask)
            assert answer.status_code == 400 and "at most" in answer.json()["error"]["message"]


def test_no_name_of_a_coding_is_looked_up(monkeypatch):
    """Python keeps each that it did not find for ever: 2 kB a request, without a key."""
    monkeypatch.setattr(codecs, "lookup", lambda name: pytest.fail(name))
    form = "multipart/form-data; boundary=x"
    for charset in ("utf-8", "UTF8", "Utf_8"):
        assert door.is_plain_form(f"{form}; charset={charset}")
    assert door.is_plain_form(form) and door.is_plain_form("application/json; charset=latin-1")
    for charset in ("utf-7", "%", "a" * 2000):
        assert not door.is_plain_form(f"{form}; charset={charset}")
