"""How much a page may send: a stalled network is forgiven, a flood is not."""

import asyncio
import itertools

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from ico3d.chat.listener import PageInput
from ico3d.chat.serving.limits import (
    FORGIVEN,
    JITTER,
    KEPT,
    PATIENCE,
    Backlogs,
    Inlet,
    SessionLimits,
    seconds,
)
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import (
    MICROPHONE_CHUNK,
    VERSION,
    Answer,
    Audio,
    Deaf,
    Error,
    Heard,
    Hello,
    Interrupt,
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


def test_no_hand_interrupts_many_times_a_second():
    """Eight talks that did so while nothing was said kept others waiting for more than a second."""
    time = Time()
    limits = SessionLimits(time)
    for _ in range(30):
        limits.check_message(Interrupt(None))
    with pytest.raises(ProtocolError, match="interruptions"):
        limits.check_message(Interrupt(None))
    for _ in range(60):
        time.now += 0.34
        limits.check_message(Interrupt(4))


@pytest.mark.parametrize("message", [Heard(0, "well", False), Deaf("network")])
def test_no_browser_recognises_many_words_a_second(message):
    time = Time()
    limits = SessionLimits(time)
    for _ in range(200):
        limits.check_message(message)
    with pytest.raises(ProtocolError, match="words"):
        limits.check_message(message)
    for _ in range(200):
        time.now += 0.051
        limits.check_message(message)


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
        assert Talk(False) not in due
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


@pytest.mark.parametrize("samples", [1, 200, 320])
def test_short_pieces_are_put_together(samples):
    """Each takes as long to handle as a long one: a sample by itself took a millisecond."""
    time = Time()
    inlet, sound = Inlet(time), np.arange(3200, dtype=np.int16)
    heard = []
    for at in range(0, 3200, samples):
        time.now += samples / 16000
        assert inlet.admit(Audio(at, sound[:0])) == []
        heard += inlet.admit(Audio(at, sound[at : at + samples], 3, at / 16000))
    assert len(heard) <= 3200 // MICROPHONE_CHUNK
    assert [one.position for one in heard] == [
        (one.sample + len(one.pcm) - samples) / 16000 for one in heard
    ]
    heard += inlet.admit(Talk(True))
    assert heard.pop() == Talk(True)
    assert np.array_equal(np.concatenate([one.pcm for one in heard]), sound)
    assert inlet.rest() == []


@pytest.mark.parametrize("samples", [512, 1600, 8000, 16000])
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


def test_a_flood_of_sound_is_looked_at_slowly():
    """A minute of it at once by each of eight talks left no answer to others for eight seconds."""
    time = Time()
    limits, backlogs, sound = SessionLimits(time), Backlogs(time), encode(chunk(0))
    assert [limits.is_late(sound) for _ in range(66)] == [False] * 64 + [True] * 2
    assert not limits.is_late("{}")
    waits = [backlogs.before_a_look() for _ in range(1000)]
    assert waits[249] == 0.0 and waits[-1] == pytest.approx(3.0)
    for _ in range(200):
        time.now += CHUNK
        assert not limits.is_late(sound)


def test_presses_let_no_more_sound_pass_than_is_spoken():
    """With thirty of them, a minute of sound was handled at once."""
    time = Time()
    inlet, heard, pressed = Inlet(time), 0.0, False
    for seconds_later in (0.0, 60.0):
        time.now += seconds_later
        before, heard = heard, 0.0
        for number in range(58):
            pressed = not pressed
            for message in (chunk(number, 16000), Talk(pressed)):
                due = inlet.admit(message)
                heard += sum(seconds(one) for one in due if isinstance(one, Audio))
    assert before == heard == KEPT + JITTER
    for sound in spoken(20):
        time.now += CHUNK
        heard += sum(map(seconds, inlet.take(sound)))
    assert heard == pytest.approx(KEPT + JITTER + 20, abs=0.1)


def test_a_backlog_is_handled_bit_by_bit_and_waits_for_its_own_machine_alone():
    """A bucket that all pages shared left others without an answer while eight filled it."""
    time = Time()
    backlogs = Backlogs(time)
    batch = [chunk(number, 16000) for number in range(5)]
    pauses = list(backlogs.pauses("192.0.2.1", [*batch, Talk(True)]))
    assert pauses == pytest.approx([0.0, 0.25, 0.5, 0.75, 0.5, 0.0])
    assert sum(pauses) == PATIENCE
    for _ in range(40):
        assert sum(backlogs.pauses("192.0.2.1", batch)) == PATIENCE
    assert set(backlogs.pauses("192.0.2.2", spoken(0.8))) == {0.0}
    assert set(backlogs.pauses("", batch)) == {0.0}
    assert list(backlogs.pauses("192.0.2.1", batch[:1])) == [0.0]  # in time


async def test_a_backlog_lets_others_have_their_turn(served, monkeypatch):
    turns, hear = [0], PageInput.hear

    async def counting(self, sound):
        heard.append(turns[0])
        await hear(self, sound)

    async def turn():
        while True:
            turns[0] += 1
            await asyncio.sleep(0)

    heard = []
    url, _ = served
    page, _ = await open_page(url, microphone=False)
    await page.heard(0)
    monkeypatch.setattr(PageInput, "hear", counting)
    for number in range(20):
        await page.send(chunk(number, 16000))
    turning = asyncio.create_task(turn())
    await page.send(Talk(True))  # what waits belongs to the time before
    while len(heard) < KEPT:
        await asyncio.sleep(0)
    turning.cancel()
    assert np.diff(heard).min() >= 1
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
