"""Whole talks while real servers fail: an apology is heard, the turn ends, the next one works."""

import asyncio
import contextlib
from dataclasses import dataclass

import pytest
from pipecat.services.openai.stt import OpenAISTTService
from pipecat.services.openai.tts import OpenAITTSService
from starlette.responses import JSONResponse, PlainTextResponse

from ico3d.chat import server
from ico3d.chat.protocol import Answer, End, Error, Speech, State, Text
from ico3d.chat.services import TABLES
from ico3d.chat.services.provider import Provider
from ico3d.chat.settings import ChatSettings, Choice, Patience
from ico3d.chat.supervision.apologies import APOLOGIES
from ico3d.measure.page import open_page

from ..conftest import serving as serving_avatar
from ..modules.serving import service_app, serving
from ..modules.test_api import make_language, make_recognition, make_voice

SORRY = APOLOGIES["en"]
QUICK = Patience(language=1.5, voice=1.5)
NOBODY = "http://127.0.0.1:9/v1"


class Fickle:
    """A server in front of ours that goes wrong for some requests."""

    def __init__(self, app, *faults):
        self.app, self.faults, self.asked = app, list(faults), 0

    async def __call__(self, scope, receive, send):
        if scope["type"] != "http" or not scope["path"].startswith("/v1/"):
            await self.app(scope, receive, send)
            return
        self.asked += 1
        fault = self.faults.pop(0) if self.faults else None
        if fault is None:
            await self.app(scope, receive, send)
        elif fault == "hang":
            await asyncio.sleep(20)
        elif fault == "garbage":
            await PlainTextResponse("<html>502 at nginx")(scope, receive, send)
        elif fault == "empty":
            await PlainTextResponse("")(scope, receive, send)
        elif isinstance(fault, int):
            await JSONResponse({"error": {"message": "no"}}, fault)(scope, receive, send)


@dataclass(frozen=True)
class Url:
    """Options of the services of these tests."""

    url: str


@pytest.fixture(autouse=True)
def providers(monkeypatch):
    """pipecat's own services as providers."""

    def voice(options, context):
        del context
        return OpenAITTSService(api_key="none", base_url=options.url)

    def recognition(options, context):
        del context
        return OpenAISTTService(api_key="none", base_url=options.url)

    monkeypatch.setitem(TABLES["voice"], "a-server", Provider("a server", Url, voice))
    monkeypatch.setitem(TABLES["recognition"], "a-server", Provider("a server", Url, recognition))


@contextlib.asynccontextmanager
async def talking(bundle, microphone=False, **services):
    """A page whose avatar has said hello."""
    settings = ChatSettings(patience=QUICK, **services)
    async with serving_avatar(bundle, settings) as (url, _):
        page, _ = await open_page(url, microphone=microphone)
        await page.heard(0)
        await page.wait(State, where=lambda m: m.state == "idle")
        try:
            yield page
        finally:
            await page.close()


async def asked(page, text="Who are you?"):
    """The captions of the answer to a typed question, once it has been heard to its end."""
    since = len(page.log)
    await page.send(Text(text))
    _, end = await page.wait(End, since)
    assert sum(len(m.pcm) for m in page.messages(Speech, since)) == end.samples > 0
    await page.heard(end.utterance)
    await page.wait(State, since, where=lambda m: m.state == "idle")
    assert page.messages(State, since)[-1].state == "idle"
    return [m.text for m in page.messages(Answer, since)]


def language_at(url):
    return Choice("openai", {"url": url, "model": "any"})


@pytest.mark.parametrize(
    "faults",
    [
        ["hang"],
        ["garbage"],
        ["empty"],
        [500] * 3,
        [404],
        [401],
    ],
)
async def test_a_language_model_that_fails_is_apologised_for(bundle, faults):
    app = Fickle(service_app("language", make_language), *faults)
    async with serving(app) as url, talking(bundle, language=language_at(f"{url}v1")) as page:
        assert " ".join(await asked(page)) == SORRY["language"]
        assert await asked(page) == ["I am Ada.", "I live in a box.", "Grüße, 你好!"]


async def test_a_language_model_that_fails_once_is_asked_again(bundle):
    app = Fickle(service_app("language", make_language), 500)
    async with serving(app) as url, talking(bundle, language=language_at(f"{url}v1")) as page:
        assert await asked(page) == ["I am Ada.", "I live in a box.", "Grüße, 你好!"]
        assert app.asked == 2


async def test_a_language_server_that_dies_and_comes_back(bundle):
    app = service_app("language", make_language)
    async with contextlib.AsyncExitStack() as stack:
        first = await stack.enter_async_context(contextlib.AsyncExitStack())
        url = await first.enter_async_context(serving(app))
        page = await stack.enter_async_context(talking(bundle, language=language_at(f"{url}v1")))
        assert (await asked(page))[0] == "I am Ada."
        await first.aclose()
        assert " ".join(await asked(page)) == SORRY["language"]
        port = int(url.split(":")[2].rstrip("/"))
        await stack.enter_async_context(serving(app, port))
        assert (await asked(page))[0] == "I am Ada."


async def test_nobody_thinks_or_speaks(bundle):
    services = {"language": language_at(NOBODY), "voice": Choice("a-server", {"url": NOBODY})}
    async with talking(bundle, **services) as page:
        assert " ".join(await asked(page)) == SORRY["language"]
        assert not page.messages(Error)  # espeak-ng spoke


@pytest.mark.parametrize("faults", [["hang"], ["empty"], [500] * 6, [401] * 2, [404] * 2])
async def test_a_voice_that_fails_is_apologised_for_and_captions_go_on(bundle, faults):
    app = Fickle(service_app("voice", make_voice))
    async with serving(app) as url:
        choice = Choice("a-server", {"url": f"{url}v1"})
        async with talking(bundle, voice=choice) as page:
            app.faults = list(faults * 2 if faults == ["empty"] else faults)
            since = len(page.log)
            assert await asked(page) == ["I am Random."]
            _, end = await page.wait(End, since)
            assert end.samples > 2 * server.protocol.SPEECH_RATE  # the apology, not the answer
            app.faults = []
            since = len(page.log)
            assert await asked(page) == ["I am Random."]
            _, end = await page.wait(End, since)
            assert end.samples < 2 * server.protocol.SPEECH_RATE


async def test_a_voice_that_fails_once_is_asked_again(bundle):
    app = Fickle(service_app("voice", make_voice))
    async with serving(app) as url:
        async with talking(bundle, voice=Choice("a-server", {"url": f"{url}v1"})) as page:
            app.asked, app.faults = 0, [404]
            since = len(page.log)
            assert await asked(page) == ["I am Random."]
            _, end = await page.wait(End, since)
            assert end.samples < 2 * server.protocol.SPEECH_RATE and app.asked == 2


async def test_a_recogniser_that_fails_is_apologised_for(bundle, question):
    app = Fickle(service_app("recognition", make_recognition), "garbage", 401)
    async with serving(app) as url:
        choice = Choice("a-server", {"url": f"{url}v1"})
        async with talking(bundle, microphone=True, recognition=choice) as page:
            since = len(page.log)
            page.say(question)
            await page.wait(End, since)
            captions = " ".join(m.text for m in page.messages(Answer, since))
            assert captions == SORRY["recognition"]
