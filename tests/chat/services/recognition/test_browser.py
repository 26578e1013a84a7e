"""The visitor's browser recognises speech: its words become turns, in time with his voice."""

import asyncio

import pytest

from ico3d.chat.services import choose
from ico3d.chat.services.recognition import browser, room
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import (
    MAX_QUESTION,
    Answer,
    Deaf,
    Error,
    Heard,
    State,
    Talk,
    Transcript,
)
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


def finals(count, letters, first=0):
    return [Heard(first + n, f"{n:03d}".ljust(letters, "a"), True) for n in range(count)]


@pytest.mark.parametrize(
    "results",
    [finals(room.MOST_RESULTS + 30, 5), finals(40, 4000), [Heard(0, "word " * 800, True)]],
    ids=["many", "long", "one"],
)
def test_a_turn_holds_no_more_than_a_typed_question(results):
    left = room.Room()
    taken = [left.take(heard.text) for heard in results]
    kept = [words for words in taken if words]
    assert len(kept) <= room.MOST_RESULTS and len(" ".join(kept)) <= MAX_QUESTION
    whole = [heard.text for heard in results[: len(kept)]]
    assert kept == [text[: len(words)] for text, words in zip(whole, kept, strict=True)]
    assert left.fit("more") == "" or len(" ".join(kept)) < MAX_QUESTION - 1
    left.clear()
    assert left.take("what is") == "what is"


async def test_of_a_flood_of_partial_words_the_newest_are_told(bundle):
    async with serving(bundle, ALONE, adapt=silent) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.send(Talk(True))
        await page.wait(State, where=lambda m: m.state == "listening")
        for number in range(90):
            await page.send(Heard(0, f"what {number}", False))
        await page.wait(Transcript, where=lambda m: m.text == "what 89")
        partial = [m.text for m in page.messages(Transcript)]
        assert partial[0] == "what 0" and len(partial) <= 20
        await page.send(Heard(0, "what is your name", True))
        await page.send(Talk(False))
        await page.wait(Answer)
        assert page.messages(Transcript)[-1].final
        await page.close()


async def test_words_of_a_held_button_end_like_typed_ones(bundle):
    async with serving(bundle, ALONE, adapt=silent) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.send(Talk(True))
        await page.wait(State, where=lambda m: m.state == "listening")
        for heard in finals(3, 1500):
            await page.send(heard)
        await page.wait(Transcript, where=lambda m: len(m.text) > 1600)
        await page.send(Talk(False))
        await page.wait(Answer)
        await page.send(Talk(True))  # a turn with room again
        await page.wait(State, where=lambda m: m.state == "listening")
        await page.send(Heard(3, "What is your name?", True))
        await page.send(Talk(False))
        await page.wait(Answer, where=lambda m: m.text == "I am Random.")
        assert max(len(m.text) for m in page.messages(Transcript)) == MAX_QUESTION
        await page.close()
