"""Recognisers that listen first and transcribe then: the turn waits for them, and no longer."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from ico3d.chat.services import ChosenService
from ico3d.chat.services.provider import Provider
from ico3d.chat.services.recognition.segments import Segments
from ico3d.chat.wire.protocol import Answer, Speech, State, Transcript
from ico3d.measure.talking.page import open_page
from support.chat.recognisers import Script, Scripted, silent
from support.chat.serving import serving

pytestmark = pytest.mark.slow


class Recogniser(Segments, Scripted):
    pass


def scripted(delay, *words):
    """Lets a server's sessions listen with a script, and greet nobody."""
    provider = Provider("script", Script, lambda script, _: Recogniser(longest=10.0, script=script))

    def adapt(avatar):
        service = ChosenService(provider, Script(delay, words))
        services = replace(avatar.services, recognition=service)
        return silent(replace(avatar, services=services))

    return adapt


async def states(page, *wanted):
    """When the page was told each of some states in turn."""
    times, since = [], 0
    for state in wanted:
        at, _ = await page.wait(State, since, where=lambda m, s=state: m.state == s)
        since = next(i for i, (t, m) in enumerate(page.log) if t == at and isinstance(m, State)) + 1
        times.append(at)
    return times


@pytest.mark.parametrize("delay", [1.0, 4.0])
async def test_the_turn_ends_with_its_transcript(bundle, question, given_up, delay):
    async with serving(bundle, adapt=scripted(delay, "What is your name?")) as (url, _):
        page, _ = await open_page(url)
        said = page.say(question)
        at, transcript = await page.wait(Transcript, where=lambda m: m.final)
        assert transcript.text == "What is your name?"
        _, thinking = await states(page, "listening", "thinking")
        assert at - said >= delay
        assert thinking - at < 0.1
        assert not given_up
        _, answer = await page.wait(Answer)
        assert answer.text == "I am Random."
        await page.close()


@pytest.mark.parametrize("words", ["", "fails"])
async def test_a_turn_without_words_ends_when_that_is_known(bundle, question, given_up, words):
    async with serving(bundle, adapt=scripted(0.8, words)) as (url, _):
        page, _ = await open_page(url)
        page.say(question)
        await states(page, "listening", "idle")
        assert not given_up
        assert not page.messages(Transcript)
        if words == "fails":
            await page.wait(Speech)  # an apology
        await page.close()


async def test_two_stretches_in_the_works_make_one_question(bundle, question):
    adapt = scripted(1.0, "What is", "your name?")
    async with serving(bundle, adapt=adapt) as (url, _):
        page, _ = await open_page(url)
        gap = np.zeros(5600, np.int16)  # 0.35 s: noticed, but too short to end a turn
        page.say(np.concatenate([question, gap, question]))
        _, last = await page.wait(Transcript, where=lambda m: m.text == "What is your name?")
        assert last.final
        _, answer = await page.wait(Answer)
        assert answer.text == "I am Random."
        await asyncio.sleep(0.5)
        assert [m.text for m in page.messages(Answer)] == ["I am Random."]
        await page.close()
