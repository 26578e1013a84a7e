"""A server that is asked to end: what is being said is said, and everybody is told."""

import asyncio
import signal
from dataclasses import replace

import pytest

from ico3d.chat.serving.running import ending
from ico3d.chat.wire.protocol import End, Speech, State, Text
from ico3d.chat.wire.sentences import ENDING
from ico3d.measure.talking.page import open_page
from support.chat.pages import first_message
from support.chat.serving import TYPED, serving, visiting
from support.chat.waiting import until

pytestmark = pytest.mark.slow
LONG = Text("nothing you know of, but a long answer")


async def idle(page):
    """Waits until the greeting has been heard."""
    await page.heard(0)
    await page.wait(State, where=lambda m: m.state == "idle")


async def last_words(page):
    """What a page is told at the end, once its connection is closed."""
    await asyncio.wait_for(page.closed(), 60)
    return page.log[-1][1]


async def test_answers_are_finished_and_nobody_new_comes_in(bundle):
    async with serving(bundle, TYPED) as (url, sessions), visiting(url) as client:
        quiet, _ = await open_page(url, microphone=False)
        talking, _ = await open_page(url, microphone=False)
        await idle(quiet)
        await idle(talking)
        await talking.send(LONG)
        await talking.wait(Speech, where=lambda m: m.utterance == 1)
        assert (await client.get("/ready")).json() == {"ready": True}
        signal.raise_signal(signal.SIGTERM)
        assert await last_words(quiet) == ENDING.error(fatal=True, again=True)
        assert not talking.messages(End) or len(sessions) == 1
        ready = await client.get("/ready")
        assert ready.status_code == 503 and ready.json() == {"ready": False}
        assert (await client.get("/health")).status_code == 200
        assert await first_message(url) == ENDING.error(fatal=True, again=True)
        assert await last_words(talking) == ENDING.error(fatal=True, again=True)
        assert [end.utterance for end in talking.messages(End)] == [0, 1]
        assert talking.has_heard(1) and len(sessions) == 0


async def test_who_waits_in_the_queue_is_told(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        first, _ = await open_page(url, microphone=False)
        waiting = asyncio.create_task(open_page(url, microphone=False))
        while not len(sessions.line):
            await asyncio.sleep(0.01)
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(TimeoutError):  # no welcome comes
            await waiting
        assert await last_words(first) == ENDING.error(fatal=True, again=True)


async def test_nobody_talks_for_longer_than_the_server_may_take(bundle, monkeypatch):
    monkeypatch.setattr(ending, "LONGEST", 0.5)
    async with serving(bundle, TYPED) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        await page.wait(Speech)
        signal.raise_signal(signal.SIGTERM)
        assert await last_words(page) == ENDING.error(fatal=True, again=True)
        assert not page.has_heard(0) and len(sessions) == 0


async def test_a_page_that_is_away_is_not_waited_for(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        await page.wait(Speech)
        page._socket.transport.abort()
        await page.close()
        while sessions.present()[0].page.is_attached:
            await asyncio.sleep(0.01)
        signal.raise_signal(signal.SIGTERM)
        await until(lambda: len(sessions) == 0, 5)
