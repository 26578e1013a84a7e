"""The visitor's browser recognises speech: its words become turns, in time with his voice."""

import asyncio

import pytest

from ico3d.chat.services import choose
from ico3d.chat.services.recognition import browser
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import Answer, Deaf, Error, Heard, State, Transcript
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.recognisers import silent
from support.chat.serving import serving

pytestmark = pytest.mark.slow

BROWSER = ChatSettings(recognition=Choice("browser", {"language": "en-US"}))
ALONE = ChatSettings(recognition=Choice("browser", {"language": "en-US", "fallback": ""}))
"""Without a decoder of the server's, which takes half a second to start."""


async def spoken(page, question):
    """Says something; returns when the server has noticed the voice."""
    page.say(question)
    await page.wait(State, where=lambda m: m.state == "listening")


async def settled(page):
    """The texts of all answers, when nothing more comes."""
    await page.wait(Answer)
    await asyncio.sleep(1.0)
    return [answer.text for answer in page.messages(Answer)]


async def test_words_of_the_page_become_a_turn(bundle, question):
    async with serving(bundle, BROWSER, adapt=silent) as (url, _):
        page, welcome = await open_page(url)
        assert welcome.dictation.language == "en-US"
        assert welcome.dictation.fallback == "pocketsphinx"
        assert welcome.services.recognition.name == "the visitor's browser"
        await spoken(page, question)
        await page.send(Heard(0, "what is", False))
        await page.send(Heard(0, "What is your name?", True))
        assert await settled(page) == ["I am Random."]
        assert [(m.text, m.final) for m in page.messages(Transcript)] == [
            ("what is", False),
            ("What is your name?", True),
        ]
        await page.close()


async def test_partial_words_are_taken_when_no_more_come(bundle, question):
    async with serving(bundle, ALONE, adapt=silent) as (url, _):
        page, _ = await open_page(url)
        await spoken(page, question)
        await page.send(Heard(0, "what is your name", False))
        _, transcript = await page.wait(Transcript, where=lambda m: m.final)
        assert transcript.text == "what is your name"
        await page.send(Heard(0, "What is your name?", True))  # the same words, late
        assert await settled(page) == ["I am Random."]
        assert len(page.messages(Transcript)) == 2
        await page.close()


async def test_a_voice_without_words_ends_its_turn(bundle, question, given_up):
    async with serving(bundle, ALONE, adapt=silent) as (url, _):
        page, _ = await open_page(url)
        await spoken(page, question)
        await page.wait(State, where=lambda m: m.state == "idle")
        assert not given_up and not page.messages(Transcript)
        await page.close()


async def test_words_without_a_voice_are_the_avatars_own(bundle):
    async with serving(bundle, ALONE, adapt=silent) as (url, _):
        page, _ = await open_page(url)
        await page.send(Heard(0, "hello I am Random", True))
        await asyncio.sleep(0.5)
        assert not page.messages(Transcript) and not page.messages(Answer)
        await page.close()


async def test_the_server_listens_where_the_browser_cannot(bundle, question):
    async with serving(bundle, BROWSER, adapt=silent) as (url, _):
        page, _ = await open_page(url)
        await page.send(Deaf("network"))
        page.say(question)
        _, transcript = await page.wait(Transcript, where=lambda m: m.final)
        assert transcript.text == "what is your name"
        assert await settled(page) == ["I am Random."]
        await page.close()


async def test_words_are_refused_where_the_server_listens(served):
    url, _ = served
    page, welcome = await open_page(url, microphone=False)
    assert welcome.dictation is None
    await page.send(Heard(0, "hello", True))
    _, error = await page.wait(Error)
    assert error.message == "this server listens itself." and not error.fatal
    await page.close()


def test_the_fallback_is_a_choice():
    nobody = choose(ChatSettings(recognition=Choice("browser", {"fallback": ""})))
    assert nobody.dictation().fallback is None
    assert isinstance(nobody.recognition.make(None), browser.BrowserRecognition)
    with pytest.raises(SettingsError, match="'browser' is unknown"):
        choose(ChatSettings(recognition=Choice("browser", {"fallback": "browser"}))).dictation()
