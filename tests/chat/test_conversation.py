"""Real talks through a real WebSocket: sound in its own time, every service the real one."""

import asyncio
import time

import numpy as np
import pytest
from pipecat.frames.frames import InputAudioRawFrame, InterruptionFrame

from ico3d.chat.frames import VoiceFrame
from ico3d.chat.observing.timing import PARTS
from ico3d.chat.supervision.language import AnswerGuard
from ico3d.chat.wire.protocol import (
    MAX_AHEAD_SECONDS,
    SPEECH_RATE,
    Answer,
    End,
    Interrupt,
    Metrics,
    Speech,
    State,
    Stop,
    Text,
    Timeline,
    Transcript,
)
from ico3d.measure.talking.page import open_page
from ico3d.measure.talking.questions import read_recording
from support.chat.pages import slowness
from support.shared import SPEECH

pytestmark = pytest.mark.slow

STARS = SPEECH / "new-home-in-the-stars-16k.wav"


def sound_of(page, utterance):
    return [m for m in page.messages(Speech) if m.utterance == utterance]


def assert_gapless(pieces, end):
    """Sound and rows of an utterance follow each other without a gap, at the same time."""
    sample = row = 0
    for piece in pieces:
        assert piece.first_sample == sample and piece.first_expression == row
        assert sample == row * SPEECH_RATE // 25
        assert 0.1 <= len(piece.pcm) / SPEECH_RATE <= 0.2
        assert len(piece.expressions) * SPEECH_RATE // 25 == len(piece.pcm)
        sample, row = sample + len(piece.pcm), row + len(piece.expressions)
    assert sample == end.samples


async def greeted(page):
    """Waits until the greeting is over on both sides; returns where the log goes on."""
    await page.heard(0)
    await page.wait(State, where=lambda m: m.state == "idle")
    return len(page.log)


@pytest.mark.slow
@pytest.mark.real_time
async def test_spoken_question_is_understood_and_answered(served, question):
    """One of the three talks that run by the real clock."""
    url, _ = served
    page, welcome = await open_page(url)
    assert welcome.services.recognition.stand_in and not welcome.resumed
    since = await greeted(page)
    said = page.say(question)
    _, transcript = await page.wait(Transcript, since, where=lambda m: m.final)
    assert transcript.text.endswith("is your name")  # the stand-in takes "what" for "but" at times
    at, _ = await page.wait(Speech, since)
    assert at - said < 1.2 * slowness()
    await page.heard(1)
    await page.wait(State, since, where=lambda m: m.state == "idle")
    states = [m.state for m in page.messages(State, since)]
    assert states == ["listening", "thinking", "speaking", "idle"]
    assert [m.text for m in page.messages(Answer, since)] == ["I am Random."]
    assert_gapless(sound_of(page, 1), page.messages(End, since)[0])
    assert not page.messages(Timeline)  # a head alone has no body to move
    rows = np.concatenate([m.expressions for m in sound_of(page, 1)]).astype(np.float32)
    assert rows.shape[1] == 39 and np.isfinite(rows).all()
    assert rows[:, :32].std(axis=0).max() > 0.01  # the mouth moves
    turn, played = page.messages(Metrics, since)[:2]
    parts = PARTS
    assert sum(turn.values[p] for p in parts) == pytest.approx(turn.values["total"], abs=0.01)
    assert turn.values["vad"] >= 199.9
    assert played.values["voice_to_voice"] >= turn.values["total"]
    await page.close()


@pytest.mark.skipif(not STARS.is_file(), reason="needs ../shared/speech")
async def test_real_speech_is_transcribed_and_silences_the_avatar(served):
    url, _ = served
    pcm = read_recording(STARS)
    page, _ = await open_page(url)
    await greeted(page)  # the guard has learnt that nothing of the avatar comes back
    await page.send(Text("nothing you know of, but a long answer"))
    _, second = await page.wait(Speech, where=lambda m: m.utterance == 1)
    spoken_at = page.say(pcm) - len(pcm) / 16000
    at, _ = await page.wait(Stop, where=lambda m: m.utterance == second.utterance)
    assert at - spoken_at < 0.65
    _, transcript = await page.wait(Transcript, where=lambda m: m.final)
    assert "find a new home" in transcript.text
    await page.wait(Speech, where=lambda m: m.utterance == 2)
    await page.close()


async def test_nothing_of_a_stopped_utterance_follows_its_stop(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    await page.wait(Speech)
    for number in range(1, 8):  # typed into the answer before, at ever other moments
        await page.send(Text("tell me something nobody has written down"))
        await page.wait(Speech, where=lambda m, n=number: m.utterance == n)
        await asyncio.sleep(0.03 * number)
    await page.send(Interrupt(None))
    await page.wait(Stop, where=lambda m: m.utterance == 7)
    await asyncio.sleep(0.3)
    stopped = {m.utterance: i for i, (_, m) in enumerate(page.log) if isinstance(m, Stop)}
    assert sorted(stopped) == list(range(8))
    for index, (_, message) in enumerate(page.log):
        utterance = getattr(message, "utterance", None)
        if utterance in stopped and not isinstance(message, Stop):
            assert index < stopped[utterance]
    assert page.messages(State)[-1].state == "idle"
    await page.close()


async def test_speech_runs_ahead_of_playback_but_not_too_far(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    await page.heard(0)
    await page.send(Text("tell me something nobody has written down"))
    await page.wait(End, where=lambda m: m.utterance == 1)
    first = next(at for at, m in page.log if isinstance(m, Speech) and m.utterance == 1)
    arrived = [(at, m) for at, m in page.log if isinstance(m, Speech) and m.utterance == 1]
    ahead = [(m.first_sample + len(m.pcm)) / SPEECH_RATE - (at - first) for at, m in arrived]
    assert max(ahead) <= MAX_AHEAD_SECONDS + 0.1
    assert min(ahead[len(ahead) // 2 :]) > 1.0  # enough to survive a slow network
    await page.close()


async def test_interrupt_of_another_utterance_stops_nothing(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    await page.wait(Speech)
    await page.send(Interrupt(5))
    await page.heard(0)
    assert not page.messages(Stop)
    await page.close()


async def test_a_cough_is_not_answered_and_ends_listening(served):
    url, _ = served
    page, _ = await open_page(url)
    since = await greeted(page)
    rng = np.random.default_rng(0)
    burst = (rng.normal(0, 6000, 4000) * np.hanning(4000)).astype(np.int16)
    page.say(burst)
    await asyncio.sleep(2.5)
    assert not page.messages(Speech, since)
    states = [m.state for m in page.messages(State, since)]
    assert states in ([], ["listening", "idle"])
    await page.close()


async def test_two_visitors_do_not_hear_each_other(typed):
    url, sessions = typed
    one, welcome_one = await open_page(url, microphone=False)
    two, welcome_two = await open_page(url, microphone=False)
    assert welcome_one.session != welcome_two.session and len(sessions) == 2
    await one.wait(Speech)
    await two.wait(Speech)
    since = len(two.log)
    await one.send(Text("who are you?"))
    await one.wait(Answer, where=lambda m: m.utterance == 1)
    await asyncio.sleep(0.5)
    assert {getattr(m, "utterance", 0) for _, m in two.log[since:]} <= {0}
    await asyncio.gather(one.close(), two.close())


async def test_typed_answers_come_at_once(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    await page.heard(0)
    asked = time.monotonic()
    await page.send(Text("Who are you?"))
    at, _ = await page.wait(Speech, where=lambda m: m.utterance == 1)
    assert at - asked < 0.5
    await page.close()


async def test_sound_goes_no_further_than_whoever_decides_on_turns(served, question, monkeypatch):
    """Each piece went through nine more processors: half of what a silent visitor cost."""
    seen, process = set(), AnswerGuard.process_frame

    async def seeing(self, frame, direction):
        seen.add(type(frame))
        await process(self, frame, direction)

    monkeypatch.setattr(AnswerGuard, "process_frame", seeing)
    url, _ = served
    page, _ = await open_page(url)
    since = await greeted(page)
    page.say(question)
    await page.wait(Speech, since)
    assert InterruptionFrame in seen
    assert not any(issubclass(kind, InputAudioRawFrame | VoiceFrame) for kind in seen)
    await page.close()
