"""Turn-taking through a real WebSocket: real Silero, Smart-Turn, pocketsphinx and espeak-ng."""

import asyncio
import time

import numpy as np
import pytest
import soxr
from websockets.asyncio.client import connect

from ico3d.chat.wire import protocol
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as CHUNK
from ico3d.chat.wire.protocol import (
    MICROPHONE_RATE,
    SPEECH_RATE,
    Answer,
    Audio,
    End,
    Hello,
    Pause,
    Resume,
    Speech,
    State,
    Stop,
    Talk,
    Text,
    Transcript,
    Welcome,
)
from ico3d.common.espeak.speech import synthesize
from ico3d.measure.talking.page import SCHEDULING, SimulatedPage, open_page
from support.chat.pages import slowness

pytestmark = pytest.mark.slow

FADE = 0.02  # s that the page takes to fall silent
UNKNOWN = "tell me something nobody has written down"  # its answer takes several seconds


def said(text):
    """(S,) int16 at 16 kHz without the silence around it."""
    speech = synthesize(text, "en-us", 150)
    samples = soxr.resample(speech.samples, speech.rate, MICROPHONE_RATE)
    loud = np.nonzero(np.abs(samples) > 0.02 * np.abs(samples).max())[0]
    return (samples[loud[0] : loud[-1] + 1] * 32767).astype(np.int16)


async def long_answer(page):
    """Has something long said; returns its number and where the log goes on."""
    await page.heard(0)
    await page.wait(State, where=lambda m: m.state == "idle")
    await page.send(Text(UNKNOWN))
    _, speech = await page.wait(Speech, where=lambda m: m.utterance > 0)
    await asyncio.sleep(0.5)
    return speech.utterance, len(page.log)


async def test_uh_huh_pauses_and_nothing_is_lost(served):
    page, _ = await open_page(served[0])
    utterance, since = await long_answer(page)
    begin = page.say(said("uh-huh")) - len(said("uh-huh")) / MICROPHONE_RATE
    paused, _ = await page.wait(Pause, since)
    assert paused + FADE - begin < 0.25
    resumed, _ = await page.wait(Resume, since)
    await page.wait(End, since, where=lambda m: m.utterance == utterance)
    await page.heard(utterance)
    assert not page.messages(Stop, since) and not page.messages(Transcript, since)
    pieces = [m for m in page.messages(Speech) if m.utterance == utterance]
    samples = np.cumsum([0, *(len(m.pcm) for m in pieces)])
    assert [m.first_sample for m in pieces] == list(samples[:-1])  # without a gap
    await page.wait(State, since, where=lambda m: m.state == "idle")
    length = samples[-1] / SPEECH_RATE
    over = page.log[-1][0] - (page.log[since - 1][0])
    assert over > length - 2.5 + (resumed - paused)  # it waited, it did not play on
    assert {m.utterance for m in page.messages(Answer, since)} <= {utterance}
    await page.close()


@pytest.mark.slow
@pytest.mark.real_time
async def test_a_question_interrupts_and_is_answered(served, question):
    """One of the three talks that run by the real clock."""
    page, _ = await open_page(served[0])
    utterance, since = await long_answer(page)
    begin = page.say(question) - len(question) / MICROPHONE_RATE
    paused, _ = await page.wait(Pause, since)
    stopped, _ = await page.wait(Stop, since)
    assert paused + FADE - begin < 0.25 * slowness()
    assert stopped - begin < 0.6 * slowness()
    _, answer = await page.wait(Answer, since, where=lambda m: m.utterance > utterance)
    assert answer.text == "I am Random."
    after = next(i for i, (_, m) in enumerate(page.log) if isinstance(m, Stop))
    assert utterance not in {m.utterance for m in page.messages(Speech, after)}
    await page.close()


async def test_the_button_ends_a_turn_at_once(served, question):
    page, _ = await open_page(served[0], microphone=False)
    utterance, since = await long_answer(page)
    await page.send(Talk(pressed=True))
    await page.wait(Stop, since)
    quiet = (question / 8).astype(np.int16)  # as loud as microphones are
    for at in range(0, len(quiet), CHUNK):
        await page.send(Audio(at, quiet[at : at + CHUNK]))
        await asyncio.sleep(CHUNK / MICROPHONE_RATE)
    released = time.monotonic()
    await page.send(Talk(pressed=False))
    _, transcript = await page.wait(Transcript, since, where=lambda m: m.final)
    assert transcript.text == "what is your name"
    at, _ = await page.wait(Speech, since, where=lambda m: m.utterance > utterance)
    assert at - released < 0.5  # there is no pause to wait for
    assert [m.state for m in page.messages(State, since)][-3:] == [
        "listening",
        "thinking",
        "speaking",
    ]
    await page.close()


class EchoPage(SimulatedPage):
    """A page whose microphone stands before its loudspeaker, without echo cancellation."""

    DELAY, GAIN = 0.12, 0.35  # s; 9 dB down

    def __init__(self, socket, microphone):
        tail = np.random.default_rng(0).normal(0, 0.05, 4000) * np.exp(-np.arange(4000) / 800)
        tail[0] = 1.0
        tail *= self.GAIN / np.sqrt((tail**2).sum())
        self._response = np.concatenate([np.zeros(int(self.DELAY * MICROPHONE_RATE)), tail])
        self._played = np.zeros(len(self._response) - 1)  # before what is played now
        self.loudest = 0.0  # of the echo
        super().__init__(socket, microphone)

    def recorded(self, said, end):
        """Adds what comes back through the room to what the visitor says."""
        played = np.concatenate([self._played, self._plays(end)])
        self._played = played[-len(self._played) :]
        back = np.convolve(played, self._response, "valid")
        self.loudest = max(self.loudest, np.abs(back).max())
        mixture = np.clip(said / 32768 + back, -1, 1)
        return super().recorded((mixture * 32767).astype(np.int16), end)

    def _plays(self, end):
        """(CHUNK,) samples that leave the loudspeaker until `end`, at the microphone's rate."""
        utterance = self.player.playing(end)
        sound = [m.pcm for m in self.messages(Speech) if m.utterance == utterance]
        if not sound:
            return np.zeros(CHUNK)
        position = self.player.position(end) + np.arange(1 - CHUNK, 1) / MICROPHONE_RATE
        pcm = np.concatenate(sound) / 32768
        return np.interp(position * SPEECH_RATE, np.arange(len(pcm)), pcm, left=0, right=0)


async def test_the_avatar_neither_interrupts_nor_answers_itself(served, question):
    socket = await connect(
        served[0].replace("http", "ws", 1).rstrip("/") + "/ws", max_size=protocol.MAX_BINARY_FRAME
    )
    page = EchoPage(socket, microphone=True)
    await page.send(Hello(protocol.VERSION, None, -1))
    await page.wait(Welcome)
    utterance, since = await long_answer(page)
    await page.heard(utterance)
    await asyncio.sleep(1.0)
    assert page.loudest > 0.05  # it did come back
    heard = [m for _, m in page.log if isinstance(m, Pause | Stop | Transcript)]
    assert heard == [] and {m.utterance for m in page.messages(Answer)} == {0, utterance}

    await page.send(Text(UNKNOWN))
    await page.wait(Speech, since, where=lambda m: m.utterance > utterance)
    await asyncio.sleep(SCHEDULING + 0.5)
    page.say(question)  # a visitor is heard all the same
    await page.wait(Stop, since)
    await page.close()
