"""Whole talks while real servers fail: an apology is heard, the turn ends, the next one works."""

import asyncio
import contextlib
from dataclasses import replace
from urllib.parse import urlsplit

import numpy as np
import pytest
from starlette.responses import JSONResponse, PlainTextResponse

from ico3d.chat.services.voice import espeak
from ico3d.chat.settings.conversation import ChatSettings, Choice, Patience
from ico3d.chat.supervision.apologies import APOLOGIES
from ico3d.chat.wire.protocol import Answer, End, Error, Speech, State, Text
from ico3d.measure.talking.page import open_page
from support.chat.remote import (
    make_language,
    make_recognition,
    make_voice,
    service_app,
    serving,
)
from support.chat.serving import BROWSER
from support.chat.serving import serving as serving_avatar

pytestmark = pytest.mark.slow

SORRY = {failed: sentence.split(". ")[0] + "." for failed, sentence in APOLOGIES["en"].items()}
NO_VOICE = espeak.spoken(APOLOGIES["en"]["voice"], "en-us", espeak.Settings().rate)
QUICK = Patience(language=3.0, voice=3.0)
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


@contextlib.asynccontextmanager
async def talking(bundle, microphone=False, **services):
    """A page whose avatar says hello."""
    services.setdefault("recognition", BROWSER)
    settings = ChatSettings(patience=QUICK, **services)
    async with serving_avatar(bundle, settings) as (url, _):
        page, _ = await open_page(url, microphone=microphone)
        await page.wait(Speech, timeout=60)
        try:
            yield page
        finally:
            await page.close()


async def asked(page, text="Who are you?"):
    """First caption of the answer to a typed question, and whether it has the voice's apology."""
    since, before = len(page.log), page.messages(Speech)[-1].utterance
    await page.send(Text(text))
    _, answer = await page.wait(Answer, since, where=lambda m: m.utterance > before)
    _, speech = await page.wait(Speech, since, where=lambda m: m.utterance == answer.utterance)
    return answer.text, np.array_equal(speech.pcm, NO_VOICE[: len(speech.pcm)])


def language_at(url):
    return Choice("openai", {"url": url, "model": "any"})


def voice_at(url):
    return Choice("openai", {"url": url})


async def test_a_language_model_that_fails_is_apologised_for(bundle):
    app = Fickle(service_app("language", make_language))
    async with serving(app) as url, talking(bundle, language=language_at(f"{url}v1")) as page:
        for faults in ([500] * 3, ["garbage"], ["empty"], [404], ["hang"]):
            app.faults = list(faults)
            assert await asked(page) == (SORRY["language"], False), faults
            assert not app.faults
            assert await asked(page) == ("I am Ada.", False)
        app.faults, app.asked = [500], 0
        assert await asked(page) == ("I am Ada.", False)
        assert app.asked == 2  # it was asked again


async def test_after_an_apology_the_turn_ends(bundle):
    async with talking(bundle, language=language_at(NOBODY), voice=voice_at(NOBODY)) as page:
        since = len(page.log)
        assert await asked(page) == (SORRY["language"], True)
        _, end = await page.wait(End, since)
        pieces = [m for m in page.messages(Speech, since) if m.utterance == end.utterance]
        assert sum(len(m.pcm) for m in pieces) == end.samples
        await page.heard(end.utterance)
        ends = page.log.index(next(entry for entry in page.log[since:] if entry[1] is end))
        await page.wait(State, ends, where=lambda m: m.state == "idle")
        assert not page.messages(Error)  # espeak-ng could speak


async def test_a_language_server_that_dies_and_comes_back(bundle):
    app = service_app("language", make_language)
    async with contextlib.AsyncExitStack() as stack:
        first = await stack.enter_async_context(contextlib.AsyncExitStack())
        url = await first.enter_async_context(serving(app))
        page = await stack.enter_async_context(talking(bundle, language=language_at(f"{url}v1")))
        assert await asked(page) == ("I am Ada.", False)
        await first.aclose()
        assert await asked(page) == (SORRY["language"], False)
        await stack.enter_async_context(serving(app, urlsplit(url).port))
        assert await asked(page) == ("I am Ada.", False)


async def test_a_voice_that_fails_is_apologised_for_and_captions_go_on(bundle):
    app = Fickle(service_app("voice", make_voice))
    async with serving(app) as url, talking(bundle, voice=voice_at(f"{url}v1")) as page:
        for faults in ([500] * 4, ["empty"] * 2, [401] * 2, [404] * 2, ["hang"]):
            app.faults = list(faults)
            assert await asked(page) == ("I am Random.", True), faults
            assert not app.faults
            assert await asked(page) == ("I am Random.", False)
        app.faults = [404]
        assert await asked(page) == ("I am Random.", False)


async def test_a_recogniser_that_fails_is_apologised_for(bundle, question):
    app = Fickle(service_app("recognition", make_recognition), "garbage", 401)
    async with serving(app) as url:
        choice = Choice("openai", {"url": f"{url}v1"})
        async with talking(bundle, microphone=True, recognition=choice) as page:
            await page.heard(0)
            await page.wait(State, where=lambda m: m.state == "idle")
            since = len(page.log)
            page.say(question)
            _, answer = await page.wait(Answer, since)
            assert answer.text == SORRY["recognition"]
            await page.wait(End, since)
            states = [m.state for m in page.messages(State, since)]
            assert states == ["listening", "thinking", "speaking"]


async def test_it_apologises_in_the_personas_language(bundle):
    def german(avatar):
        persona = replace(avatar.persona, languages=("de",))
        return replace(avatar, persona=persona)

    settings = ChatSettings(BROWSER, language_at(NOBODY), patience=QUICK)
    async with serving_avatar(bundle, settings, adapt=german) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.wait(Speech, timeout=60)
        caption, _ = await asked(page)
        assert APOLOGIES["de"]["language"].startswith(caption)
        await page.close()
