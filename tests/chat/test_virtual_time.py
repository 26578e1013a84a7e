"""Conversations on a clock that jumps: what the server waits for, to the millisecond."""

import asyncio
import math
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ico3d.chat.observing.metrics import Monitor
from ico3d.chat.settings.conversation import ChatSettings, Turns
from ico3d.chat.wire.protocol import VERSION, Error, Hello, Metrics, Speech, Text
from ico3d.errors import SettingsError
from ico3d.measure.talking.scripted import Script
from support.chat.guests import Guest, open_sessions
from support.chat.virtual_time import run

pytestmark = pytest.mark.slow

SHARE = 0.060  # s that a server may add to what its services take
TURNS = Turns(pause=0.2, end_silence=0.6, speculate=False)
QUICK = Script(0.0, 0.0, 0.0)
MOST_THREADS = 32  # threads that a loop's default executor has at most


@pytest.mark.parametrize("script", [QUICK, Script(0.1, 0.3, 0.2)])
def test_the_server_waits_for_nothing_but_its_services(bundle, question, script):
    async def talk():
        async with open_sessions(bundle, script.services(), ChatSettings(turns=TURNS)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(3)  # the greeting
            shares = []
            for pause in (3.0, 3.013):  # other places on the grids of chunks and frames
                said = await guest.say(question, silence=pause)
                at, _ = guest.got(Speech, said)[0]
                _, metrics = guest.got(Metrics, said)[0]
                waited = TURNS.end_silence if metrics.values["turn"] > 350 else TURNS.pause
                decided = max(waited, TURNS.pause + script.recognition)
                shares.append(at - said - decided - script.language - script.voice)
            await guest.leave()
            return shares

    shares = run(talk())
    print(f"the server's own share: {[round(1000 * share) for share in shares]} ms")
    assert max(shares) <= SHARE


@pytest.mark.parametrize(("speculate", "token"), [(False, 400), (True, 300)])
def test_the_turn_is_timed_as_it_was(bundle, question, speculate, token):
    """The turn is over 400 ms after silence was noticed; an early answer begins 100 ms before."""
    script = Script(recognition=0.3, language=0.4, voice=0.2)
    turns = replace(TURNS, speculate=speculate)

    async def talk():
        async with open_sessions(bundle, script.services(), ChatSettings(turns=turns)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(3)
            said = await guest.say(question, silence=4.0)
            at, _ = guest.got(Speech, said)[0]
            (_, turn), (_, played) = guest.got(Metrics, said)
            await guest.leave()
            return at - said, turn.values, played.values["voice_to_voice"]

    took, parts, heard = run(talk())
    assert parts["vad"] == pytest.approx(200, abs=1)
    assert parts["recognition"] == pytest.approx(300, abs=1)
    assert parts["turn"] == pytest.approx(400, abs=40)  # a chunk
    assert parts["turn"] + parts["token"] == pytest.approx(400 + token, abs=40)
    assert parts["voice"] == pytest.approx(200, abs=1)
    assert parts["clause"] + parts["expression"] + parts["send"] < 1
    assert parts["total"] == pytest.approx(1000 * took, abs=60)  # chunks of 32 ms
    assert heard == pytest.approx(parts["total"] + 50, abs=1)  # as the page schedules it


def test_a_session_in_which_nothing_happens_ends_with_a_sentence(bundle, question):
    monitor = Monitor()
    settings = ChatSettings(idle_minutes=1)
    long = replace(QUICK, seconds=10.0)

    async def stay():
        now = asyncio.get_running_loop().time
        async with open_sessions(bundle, long.services(), settings, monitor) as sessions:
            guests = [await Guest.enter(sessions) for _ in range(3)]
            began = now()
            await asyncio.sleep(10 + 50)  # the greeting, then silence
            await guests[0].session.conversation.handle(Text("still there?"))  # answers for 10 s
            await guests[1].say(question, silence=0.8)  # interrupts nothing, is answered
            ends = {}
            while len(ends) < 3 and now() < began + 300:
                await asyncio.sleep(1)
                for number, guest in enumerate(guests):
                    for at, error in guest.got(Error):
                        ends.setdefault(number, (at - began, error))
            left = len(sessions)
            for guest in guests:
                await guest.leave()
            return ends, left

    ends, left = run(stay())
    sentence = "Nothing was said for 1 min, so this conversation has ended."
    error = Error(sentence, fatal=True, again=True, code="idle", values={"minutes": 1})
    assert [told for _, told in ends.values()] == 3 * [error]
    assert ends[2][0] == pytest.approx(10 + 60, abs=0.5)
    assert ends[0][0] == pytest.approx(60 + 10 + 60, abs=0.5)
    assert ends[1][0] == pytest.approx(60 + 10 + 60, abs=3)
    assert left == 0
    assert monitor.exposition().count(b'sessions_ended_total{why="idle"} 3.0') == 1


@pytest.mark.parametrize("minutes", [-1, math.inf, math.nan])
def test_a_limit_that_is_none_is_one_sentence(minutes):
    with pytest.raises(SettingsError, match="idle_minutes"):
        ChatSettings(idle_minutes=minutes)


def test_without_a_limit_sessions_stay(bundle):
    async def stay():
        services = QUICK.services()
        async with open_sessions(bundle, services, ChatSettings(idle_minutes=0)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(1200)
            await guest.leave()
            return len(sessions)

    assert run(stay()) == 1


@pytest.mark.parametrize("away", [0.0, 3.0, 29.9])
@pytest.mark.parametrize("behind", [0, 4])
def test_after_a_drop_speech_goes_on_with_the_very_next_piece(bundle, monkeypatch, away, behind):
    script = replace(QUICK, seconds=8.0)

    async def talk():
        async with open_sessions(bundle, script.services()) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2.5)
            session = guest.session
            made = []
            send = session.page.send
            monkeypatch.setattr(session.page, "send", lambda m: (made.append(m), send(m)))
            await guest.leave()
            before = guest.speech()[: len(guest.speech()) - behind]  # the last ones were lost
            await asyncio.sleep(away)
            again = await Guest.enter(sessions, Hello(VERSION, session.id, before[-1].index))
            assert again.session is session
            await asyncio.sleep(12)
            await again.leave()
            return before, again.speech(), guest.speech() + [m for m in made if type(m) is Speech]

    before, after, everything = run(talk())
    indices = [message.index for message in before + after]
    assert indices == list(range(len(indices)))
    assert sum(len(message.pcm) for message in before + after) == 8 * 24000
    for got, sent in zip(before + after, everything, strict=True):
        assert got is sent or (got.pcm == sent.pcm).all()


def test_a_session_waits_for_30_seconds(bundle):
    async def talk():
        async with open_sessions(bundle, QUICK.services()) as sessions:
            guest = await Guest.enter(sessions)
            await guest.leave()
            await asyncio.sleep(30.1)
            again = await Guest.enter(sessions, Hello(VERSION, guest.session.id, 3))
            await again.leave()
            return guest.session is again.session

    assert run(talk()) is False


def test_nobody_hears_another_ones_answer(bundle):
    services = replace(QUICK, pitch=200.0, apart=100.0).services()

    async def talk():
        settings = ChatSettings(max_sessions=3)
        async with open_sessions(bundle, services, settings) as sessions:
            guests = [await Guest.enter(sessions) for _ in range(3)]
            await asyncio.sleep(1)
            for guest in guests[1:]:
                await guest.session.conversation.handle(Text("and now?"))
                await asyncio.sleep(0.3)
            await asyncio.sleep(4)
            heard = [guest.speech() for guest in guests]
            for guest in guests:
                await guest.leave()
            return heard

    heard = run(talk())
    assert [{m.utterance for m in messages} for messages in heard] == [{0}, *[{0, 1}] * 2]
    for number, messages in enumerate(heard):
        assert {loudest(m.pcm) for m in messages if len(m.pcm) >= 2400} == {200 + 100 * number}


def loudest(pcm):
    """The loudest of the tones, Hz."""
    times = np.arange(2400) / 24000
    tones = np.arange(100, 1200, 100)
    waves = np.exp(-2j * np.pi * tones[:, None] * times)
    return int(tones[np.abs(waves @ pcm[:2400]).argmax()])


def test_nine_sessions_leave_no_more_behind_than_three(bundle):
    script = replace(QUICK, seconds=1.0)

    async def visit(sessions):
        guest = await Guest.enter(sessions)
        await asyncio.sleep(0.5)
        await guest.session.conversation.handle(Text("and now?"))
        await asyncio.sleep(0.5)
        await guest.leave()
        await asyncio.sleep(31)

    async def visits():
        async with open_sessions(bundle, script.services()) as sessions:
            sizes = []
            # A pool grows when work overlaps: it has all of its threads before they are counted.
            await asyncio.gather(
                *(asyncio.to_thread(time.sleep, 0.01) for _ in range(MOST_THREADS))
            )
            for count in (3, 6):
                for _ in range(count):
                    await visit(sessions)
                sizes.append((len(asyncio.all_tasks()), threading.active_count(), resident()))
            assert len(sessions) == 0
            return sizes

    (tasks, threads, memory), (more_tasks, more_threads, more_memory) = run(visits())
    print(f"{(more_memory - memory) / 6e6:.2f} MB for each of 6 sessions")
    assert more_tasks == tasks and more_threads <= threads
    assert more_memory - memory < 6 * 2e6  # what a session takes is five times that


def resident():
    """Bytes of memory that the process holds."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
