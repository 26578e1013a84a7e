"""How much a page may send: a stalled network is forgiven, a flood is not."""

import asyncio
import itertools

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from ico3d.chat.serving.limits import FORGIVEN, KEPT, Inlet, SessionLimits, seconds
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import (
    MICROPHONE_CHUNK,
    VERSION,
    Answer,
    Audio,
    Error,
    Hello,
    Say,
    Talk,
    Text,
)
from ico3d.errors import ProtocolError
from ico3d.measure.talking.page import open_page

pytestmark = pytest.mark.slow

CHUNK = MICROPHONE_CHUNK / 16000  # s


class Time:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def chunk(number, samples=MICROPHONE_CHUNK):
    return Audio(number * samples, np.zeros(samples, np.int16))


def spoken(seconds, first=0):
    return [chunk(first + number) for number in range(round(seconds / CHUNK))]


def check(limits, sound):
    limits.check_frame(encode(sound))
    limits.check_message(sound)


def test_a_page_may_be_clumsy_a_few_times_only():
    limits = SessionLimits(Time())
    assert [limits.forgive() for _ in range(FORGIVEN)] == [True] * (FORGIVEN - 1) + [False]


def test_clumsiness_is_forgotten():
    time = Time()
    limits = SessionLimits(time)
    for _ in range(100):
        assert limits.forgive()
        time.now += 10.0


@pytest.mark.parametrize("kind", [Text, Say])
def test_nobody_types_several_questions_a_second(kind):
    time = Time()
    limits = SessionLimits(time)
    for _ in range(10):
        limits.check_message(kind("who are you"))
    with pytest.raises(ProtocolError, match="questions"):
        limits.check_message(kind("who are you"))
    for _ in range(60):
        time.now += 1.0
        limits.check_message(kind("who are you"))


def test_no_hand_presses_a_button_many_times_a_second():
    """Each press had a hosted recogniser asked, and a gigabyte of silence queued in 16 minutes."""
    time = Time()
    limits = SessionLimits(time)
    for _ in range(30):
        limits.check_message(Talk(True))
        limits.check_message(Talk(False))
    with pytest.raises(ProtocolError, match="presses"):
        limits.check_message(Talk(True))
    for _ in range(60):
        limits.check_message(Talk(False))  # or the microphone would stay open
        time.now += 0.34
        limits.check_message(Talk(True))


def test_rates_are_limited_by_the_clock():
    time = Time()
    limits = SessionLimits(time)
    for _ in range(200):
        limits.check_frame("{}")
    with pytest.raises(ProtocolError):
        limits.check_frame("{}")
    time.now += 1.0
    for _ in range(100):
        limits.check_frame("{}")
    with pytest.raises(ProtocolError):
        limits.check_frame("{}")


@pytest.mark.parametrize("seconds", [1.0, 5.0, 20.0, 59.0])
def test_sound_that_a_stall_held_back_breaks_no_rule(seconds):
    time = Time()
    limits = SessionLimits(time)
    for _ in range(10):
        time.now += seconds
        for sound in spoken(seconds):
            check(limits, sound)


@pytest.mark.parametrize("speed", [2.0, 4.0, 100.0])
def test_sound_at_several_times_real_time_is_a_flood(speed):
    time = Time()
    limits, sent = SessionLimits(time), 0.0
    with pytest.raises(ProtocolError, match="more"):
        while sent < 600:
            time.now += CHUNK / speed
            check(limits, chunk(0))
            sent += CHUNK
    assert 60 <= sent <= 60 / (1 - 1.25 / speed) + 1
    broken = 0
    while limits.forgive() and broken < 1000:  # and it is not forgiven while it lasts
        with pytest.raises(ProtocolError):
            for _ in itertools.count():
                time.now += CHUNK / speed
                check(limits, chunk(0))
        broken += 1
    assert broken < 12


def test_releasing_a_button_that_is_up_lets_no_backlog_pass():
    """A minute of sound at once, with releases between, held up everybody for seconds."""
    inlet, heard = Inlet(Time()), 0.0
    for number in range(58):
        messages = [chunk(number, 16000), Talk(False)]
        due = [one for message in messages for one in inlet.admit(message)]
        assert due[-1] == Talk(False)
        heard += sum(seconds(one) for one in due if isinstance(one, Audio))
    assert heard == 0.0
    assert sum(map(seconds, inlet.rest())) == KEPT
    assert [type(one) for one in inlet.admit(Talk(True))] == [Talk]


def test_sound_in_time_is_heard_as_it_comes():
    time = Time()
    inlet = Inlet(time)
    for sound in spoken(60):
        time.now += CHUNK
        assert inlet.take(sound) == [sound]


@pytest.mark.parametrize("samples", [320, 1600, 8000, 16000])
def test_longer_messages_are_heard_too(samples):
    time = Time()
    inlet, heard = Inlet(time), []
    sounds = [chunk(number, samples) for number in range(32000 // samples + 2)]
    for sound in sounds:
        time.now += samples / 16000
        heard += inlet.take(sound)
    assert heard == sounds


def test_a_hiccup_of_less_than_a_second_loses_nothing():
    time = Time()
    inlet, heard = Inlet(time), []
    sounds = spoken(4)
    for sound in sounds[:60]:
        time.now += CHUNK
        heard += inlet.take(sound)
    time.now += 28 * CHUNK
    for sound in sounds[60:88]:
        heard += inlet.take(sound)
    for sound in sounds[88:]:
        time.now += CHUNK
        heard += inlet.take(sound)
    assert heard == sounds


def test_of_a_backlog_the_latest_seconds_are_heard():
    time = Time()
    inlet = Inlet(time)
    for sound in spoken(10):
        time.now += CHUNK
        inlet.take(sound)
    time.now += 20.0
    late, fresh = spoken(20, first=312), spoken(2, first=312 + 625)
    heard = [sound.sample for message in late for sound in inlet.take(message)]
    assert heard == [message.sample for message in late[:3]]  # it might have been a pause
    for number, sound in enumerate(fresh):
        time.now += CHUNK
        now = [message.sample for message in inlet.take(sound)]
        if number < 6:
            assert now == []
        elif number == 6:  # 0.2 s after the last of it: sound comes in time again
            assert now == [message.sample for message in [*late, *fresh[:7]][-157:]]
        else:
            assert now == [sound.sample]


def test_after_a_pause_the_first_word_is_heard_at_once():
    time = Time()
    inlet = Inlet(time)
    for _ in range(5):  # the button of push to talk: samples count on, time has gone by
        time.now += 30.0
        for sound in spoken(2):
            time.now += CHUNK
            assert inlet.take(sound) == [sound]


def test_what_waits_can_be_had_for_something_that_comes_after_it():
    time = Time()
    inlet = Inlet(time)
    time.now += 20.0
    for sound in (sounds := spoken(20)):
        inlet.take(sound)
    assert inlet.rest() == sounds[-156:] and inlet.rest() == []


async def test_a_stalled_sender_goes_on_talking(served, question):
    url, sessions = served
    page, _ = await open_page(url, microphone=False)
    await page.heard(0)
    for sound in spoken(20):  # as a network does that comes back after so long
        await page.send(sound)
    words = np.concatenate([question, np.zeros(16000 * 2, np.int16)])
    for at in range(0, len(words) - MICROPHONE_CHUNK, MICROPHONE_CHUNK):
        await asyncio.sleep(CHUNK)
        await page.send(Audio(at, words[at : at + MICROPHONE_CHUNK]))
    await page.wait(Answer, where=lambda m: m.utterance == 1)
    assert not page.messages(Error) and len(sessions) == 1
    await page.close()


async def test_a_flood_of_sound_ends_the_conversation(typed):
    url, _ = typed
    second = encode(Audio(0, np.zeros(16000, np.int16)))
    async with connect(url.replace("http", "ws") + "ws") as socket:
        await socket.send(encode(Hello(VERSION, None, -1)))
        for _ in range(100):
            await socket.send(second)
        messages = []
        with pytest.raises(ConnectionClosed):
            while True:
                messages.append(decode_server(await socket.recv()))
    fatal = [m for m in messages if isinstance(m, Error) and m.fatal]
    assert [error.again for error in fatal] == [True]
    assert socket.close_code == 1008
