"""Sessions: resume after a drop, no leaks, no more than there is room for."""

import asyncio
import contextlib
import threading
import time
from dataclasses import replace
from unittest import mock

import pytest
from websockets.asyncio.client import connect

from ico3d.chat.serving.limits import RETURNS, RETURNS_AT_ONCE
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import (
    BEAT_SECONDS,
    VERSION,
    Answer,
    Beat,
    Error,
    Hello,
    Place,
    Speech,
    State,
    Stop,
    Text,
    Welcome,
)
from ico3d.chat.wire.sentences import FULL
from ico3d.measure.talking.page import open_page
from support.chat.serving import TYPED, serving
from support.chat.waiting import until

pytestmark = pytest.mark.slow


async def dropped(page):
    """Cuts the connection as a broken network does."""
    page._socket.transport.abort()
    await page.close()


async def test_a_dropped_page_gets_what_it_missed(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await page.wait(Speech)
        await page.send(Text("nothing you know of, but a long answer"))
        await page.wait(Speech, where=lambda m: m.utterance == 1 and m.first_sample > 10000)
        await dropped(page)
        last = page.messages(Speech)[-1].index
        await asyncio.sleep(1.0)
        again, second = await open_page(url, welcome.session, last - 3, microphone=False)
        assert second.resumed and second.session == welcome.session and len(sessions) == 1
        await again.heard(1)
        indices = [m.index for m in again.messages(Speech)]
        assert indices == list(range(last - 2, last - 2 + len(indices)))
        answers = page.messages(Answer) + again.messages(Answer)  # told before or after the drop
        assert answers[-1].utterance == 1
        await again.send(Text("who are you"))
        await again.wait(Speech, where=lambda m: m.utterance == 2)
        await again.close()


async def test_nothing_is_sent_ahead_while_the_page_is_away(bundle):
    async with serving(bundle, TYPED) as (url, _):
        page, welcome = await open_page(url, microphone=False)
        await page.wait(Speech)
        await page.send(Text("nothing you know of, but a long answer"))
        await page.wait(Speech, where=lambda m: m.utterance == 1)
        await dropped(page)
        await asyncio.sleep(2.5)
        again, _ = await open_page(url, welcome.session, -1, microphone=False)
        await again.wait(State)
        missed = [m for m in again.messages(Speech) if m.utterance == 1]
        assert sum(len(m.pcm) for m in missed) / 24000 < 2.9
        await again.close()


async def test_what_was_stopped_is_not_sent_again(bundle):
    async with serving(bundle, TYPED) as (url, _):
        page, welcome = await open_page(url, microphone=False)
        await page.wait(Speech)
        await page.send(Text("who are you"))
        await page.wait(Stop)
        await page.wait(Speech, where=lambda m: m.utterance == 1)
        await dropped(page)
        again, _ = await open_page(url, welcome.session, -1, microphone=False)
        await again.wait(State)
        assert {m.utterance for m in again.messages(Speech)} == {1}
        assert [m.utterance for m in again.messages(Stop)] == [0]
        await again.close()


async def test_a_second_connection_takes_the_session_over(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        again, second = await open_page(url, welcome.session, -1, microphone=False)
        assert second.resumed
        assert await asyncio.wait_for(page.closed(), 5) == 1000
        await asyncio.sleep(0.1)
        assert len(sessions) == 1
        await again.send(Text("who are you"))
        await again.wait(Answer, where=lambda m: m.utterance == 1)
        await asyncio.gather(page.close(), again.close())


async def test_a_line_that_closes_late_ends_no_session_that_goes_on(bundle):
    async with serving(bundle, TYPED, resume_seconds=1.0) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        (session,) = sessions.present()
        first = session.page._outbox
        second, _ = await open_page(url, welcome.session, -1, microphone=False)
        await dropped(second)
        while session.page.is_attached:
            await asyncio.sleep(0.01)
        sessions.leave(session, first)  # of which nothing was heard until now
        again, told = await open_page(url, welcome.session, -1, microphone=False)
        await asyncio.sleep(1.5)
        assert told.resumed and sessions.present() == [session]
        await asyncio.gather(page.close(), again.close())


async def test_a_line_that_carries_nothing_else_beats(bundle):
    async with serving(bundle, TYPED) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.heard(0)
        silent, begun = len(page.log), time.monotonic()
        await asyncio.sleep(3.5 * BEAT_SECONDS)
        beats = (time.monotonic() - begun) / BEAT_SECONDS
        assert 2 <= len(page.messages(Beat, silent)) <= beats + 1
        await page.close()


async def test_sessions_end_and_leave_nothing_behind(bundle):
    async with serving(bundle, resume_seconds=0.2) as (url, sessions):
        await visit(url)  # the first one starts threads that serve all
        await emptied(sessions)
        tasks, threads = len(asyncio.all_tasks()), set(threading.enumerate())
        for _ in range(2):
            await visit(url)
            await emptied(sessions)
        await until(lambda: len(asyncio.all_tasks()) <= tasks)
        new = {t.name for t in set(threading.enumerate()) - threads}
        assert all(name.startswith("asyncio_") for name in new)  # the loop's own pool, bounded


async def visit(url):
    page, _ = await open_page(url)
    await page.wait(Speech)
    await page.send(Text("who are you"))
    await page.wait(Speech, where=lambda m: m.utterance == 1)
    await dropped(page)


async def emptied(sessions):
    await until(lambda: not (len(sessions) or sessions._closing))


async def test_an_expired_session_starts_anew(bundle):
    async with serving(bundle, TYPED, resume_seconds=0.1) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await dropped(page)
        await emptied(sessions)
        again, second = await open_page(url, welcome.session, 3, microphone=False)
        assert not second.resumed and second.session != welcome.session
        await again.close()


@contextlib.asynccontextmanager
async def wire(url, session=None):
    """A connection that has said hello."""
    async with connect(url.replace("http", "ws") + "ws") as socket:
        await socket.send(encode(Hello(VERSION, session, -1)))
        yield socket


async def told(socket):
    """The next message."""
    return decode_server(await asyncio.wait_for(socket.recv(), 40))


async def placed(socket, position):
    """The message that tells a page this position in the queue."""
    while not isinstance(place := await told(socket), Place) or place.position != position:
        pass
    return place


async def admitted(socket):
    """The message that ends the wait in the queue."""
    while isinstance(message := await told(socket), Place):
        pass
    assert isinstance(message, Welcome) and not message.resumed
    return message


async def test_a_dropped_visitor_keeps_his_place(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=2)) as (url, sessions):
        (first, welcome), (second, _) = [await open_page(url, microphone=False) for _ in "12"]
        await dropped(first)
        async with wire(url) as other:
            assert await told(other) == Place(mock.ANY, 1, None)
            again, resumed = await open_page(url, welcome.session, -1, microphone=False)
            assert resumed.resumed and len(sessions) == 2
        await asyncio.gather(again.close(), second.close())


async def test_a_place_is_kept_for_so_long_and_then_given_away(bundle):
    settings = replace(TYPED, max_sessions=1)
    async with serving(bundle, settings, resume_seconds=0.3) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await dropped(page)
        await emptied(sessions)
        other, _ = await open_page(url, microphone=False)
        async with wire(url, welcome.session) as late:
            assert (await told(late)).position == 1  # like everybody else
            await other._socket.close(1000)
            await other.close()
            await admitted(late)


async def test_visitors_of_a_full_house_wait_in_order_and_join_by_themselves(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        await asyncio.sleep(60)
        async with wire(url) as second:
            place = await told(second)
            assert place.position == 1 and place.seconds is None
            async with wire(url) as third, wire(url) as fourth:
                assert (await placed(third, 2)).session != place.session
                await placed(fourth, 3)
                third.transport.abort()
                await page._socket.close(1000)
                await page.close()
                assert (await admitted(second)).session == place.session
                estimate = await placed(fourth, 2)  # the third one is only away
                assert estimate.seconds == pytest.approx(120, abs=3)
        await until(lambda: len(sessions.line) <= 1)  # who closed the page is forgotten at once


async def test_a_dropped_page_takes_its_place_in_the_queue_again(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, _):
        page, _ = await open_page(url, microphone=False)
        async with wire(url) as first, wire(url) as last:
            place = await told(first)
            await placed(last, 2)
            first.transport.abort()
            await asyncio.sleep(20)
            async with wire(url, place.session) as again:
                assert (await told(again)).session == place.session
                await page._socket.close(1000)
                await page.close()
                assert (await admitted(again)).session == place.session
                await placed(last, 1)


async def returned_too_often(url, session, is_taken):
    """Comes back as often as one may at once, is refused, and waits until one may again."""
    for _ in range(RETURNS_AT_ONCE):
        async with wire(url, session) as again:
            assert is_taken(await told(again))
            again.transport.abort()
    async with wire(url, session) as again:
        await again.wait_closed()  # without a word that would end the session or the wait
        assert again.close_code == 1013
    await asyncio.sleep(1 / RETURNS)


async def test_a_place_in_the_queue_is_not_taken_again_without_end(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        async with wire(url) as first:
            place = await told(first)
            await returned_too_often(url, place.session, lambda t: t.session == place.session)
            async with wire(url, place.session) as again:
                assert (await told(again)).session == place.session and len(sessions.line) == 1
        await page.close()


async def test_the_queue_has_an_end(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        sessions.line._most = 1
        async with wire(url) as first, wire(url) as second:
            await told(first)
            assert await told(second) == FULL.error(fatal=True, again=True)
            await second.wait_closed()
            assert second.close_code == 1013
            await first.send(encode(Text("is it my turn?")))  # who waits has nothing to say
            while isinstance(message := await told(first), Place):
                pass
            assert isinstance(message, Error) and message.fatal and len(sessions.line) == 0
        await page.close()


async def test_who_leaves_makes_room_at_once(bundle):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        for code in (1000, 1001):  # the visitor chose to; the tab was closed or loaded anew
            page, _ = await open_page(url, microphone=False)
            await page._socket.close(code)
            await page.close()
            async with asyncio.timeout(2):
                while len(sessions):
                    await asyncio.sleep(0.02)


async def test_limits_stay_when_a_page_comes_back(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        (session,) = sessions.present()
        limits, inlet = session.limits, session.inlet
        while limits.forgive():
            pass
        await dropped(page)
        async with wire(url, welcome.session) as again:
            assert (await told(again)).resumed
            assert (session.limits, session.inlet) == (limits, inlet)
            await again.send("nonsense")
            await again.wait_closed()
            assert again.close_code == 1008


async def test_a_page_that_comes_back_without_end_has_to_wait(bundle):
    async with serving(bundle, TYPED) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await dropped(page)
        await returned_too_often(url, welcome.session, lambda t: t.resumed)
        async with wire(url, welcome.session) as again:
            assert (await told(again)).resumed and len(sessions) == 1
