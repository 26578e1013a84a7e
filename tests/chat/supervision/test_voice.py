"""A voice that fails is tried once more, then apologised for; every answer has its sound."""

import asyncio

import numpy as np
import pytest
from pipecat.frames.frames import ErrorFrame, TTSAudioRawFrame

from ico3d.chat.services.voice import espeak, lasting
from ico3d.chat.supervision.apologies import APOLOGIES, apology, espeak_voice
from ico3d.chat.supervision.voice import EnduringVoice, silence
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import MissingExtraError

SORRY = espeak.spoken(apology("voice", "en"), "en-us", espeak.Settings().rate)
SAID = np.arange(480, dtype=np.int16)
TEXT = "Well, this is my answer."


class Voice:
    """A voice that does what it is told, request by request."""

    def __init__(self, *ways):
        self.ways, self.asked = list(ways), 0
        self.complaints = []

    async def run_tts(self, text, context_id):
        self.asked += 1
        way = self.ways.pop(0) if self.ways else "well"
        if way == "hang":
            await asyncio.sleep(60)
        if way == "raise":
            raise ConnectionError("nobody is there")
        if way == "report":
            yield ErrorFrame("no such voice")
        if way == "later":
            yield None
        if way in ("well", "half"):
            yield TTSAudioRawFrame(SAID.tobytes(), SPEECH_RATE, 1, context_id=context_id)
        if way == "half":
            raise ConnectionError("it broke off")

    def enduring(self):
        return EnduringVoice(self.run_tts, 0.2, "en", self.complaints.append)


async def said(enduring, text=TEXT, context_id="a"):
    """Samples and errors of one sentence."""
    frames = [frame async for frame in enduring.run_tts(text, context_id)]
    sounds = [f for f in frames if isinstance(f, TTSAudioRawFrame)]
    assert all(f.context_id == context_id for f in sounds)
    pcm = [np.frombuffer(f.audio, np.int16) for f in sounds]
    errors = [f.error for f in frames if isinstance(f, ErrorFrame)]
    return np.concatenate([np.zeros(0, np.int16), *pcm]), errors


@pytest.mark.parametrize("way", ["raise", "report", "silent"])
async def test_what_fails_once_is_tried_again(way):
    voice = Voice(way)
    pcm, errors = await said(voice.enduring())
    np.testing.assert_array_equal(pcm, SAID)
    assert not errors and voice.asked == 2


@pytest.mark.parametrize(
    ("ways", "reason", "asked"),
    [
        (["raise"] * 9, "nobody is there", 2),
        (["report"] * 9, "no such voice", 2),
        (["silent"] * 9, "it gave no sound", 2),
        (["hang"] * 9, "it gave no sound for 0.2 s", 1),
        (["raise", "hang"], "it gave no sound for 0.2 s", 2),
    ],
)
async def test_what_goes_on_failing_is_apologised_for_once_per_answer(ways, reason, asked):
    voice = Voice(*ways)
    enduring = voice.enduring()
    pcm, errors = await said(enduring)
    np.testing.assert_array_equal(pcm[: len(SORRY)], SORRY)
    assert errors == [f"the voice failed: {reason}"] and voice.asked == asked
    pcm, errors = await said(enduring, "The rest is read." * 3)
    assert not pcm.any() and len(pcm) == len(silence("The rest is read." * 3)) and not errors
    voice.ways = []
    pcm, _ = await said(enduring, context_id="b")
    np.testing.assert_array_equal(pcm, SAID)


async def test_half_a_sentence_is_not_said_twice():
    voice = Voice("half")
    pcm, errors = await said(voice.enduring())
    np.testing.assert_array_equal(pcm[: len(SAID)], SAID)
    np.testing.assert_array_equal(pcm[len(SAID) :][: len(SORRY)], SORRY)
    assert voice.asked == 1 and errors == ["the voice failed: it broke off"]


class Endless(Voice):
    """A voice that goes on and on, in pieces of a second."""

    given = 0

    async def run_tts(self, text, context_id):
        self.asked += 1
        while True:
            self.given += 1
            yield TTSAudioRawFrame(bytes(2 * SPEECH_RATE), SPEECH_RATE, 1, context_id=context_id)


async def test_a_voice_without_end_is_ended_and_apologised_for():
    voice, text = Endless(), "a" * 30
    enduring = voice.enduring()
    pcm, errors = await said(enduring, text)
    assert len(pcm) == 60 * SPEECH_RATE + len(SORRY) and voice.given == 61
    assert errors == ["the voice failed: its sound is much longer than the text."]
    pcm, _ = await said(enduring, text)  # the rest of that answer is read
    assert not pcm.any() and voice.asked == 1
    pcm, _ = await said(enduring, "Yes.", context_id="b")
    assert len(pcm) <= 20 * SPEECH_RATE + len(SORRY)


async def test_an_answer_has_so_much_sound_and_the_next_one_as_much(monkeypatch):
    monkeypatch.setattr(lasting, "MOST", 45.0)

    async def slow(text, context_id):
        asked.append(context_id)
        yield TTSAudioRawFrame(bytes(30 * SPEECH_RATE), SPEECH_RATE, 1, context_id=context_id)

    asked = []
    voice = lasting.Lasting(slow)
    for answer in ("a", "b"):
        told = [[type(f) async for f in voice.run_tts("Hello.", answer)] for _ in range(5)]
        assert told == [[TTSAudioRawFrame]] * 3 + [[ErrorFrame]] * 2
    assert asked == ["a"] * 3 + ["b"] * 3  # 45 s are used up: nobody is asked any more


async def test_sound_that_comes_by_another_way_is_no_silence():
    pcm, errors = await said(Voice("later").enduring())
    assert len(pcm) == 0 and not errors


async def test_where_nothing_can_speak_the_page_is_told_and_captions_stay(monkeypatch):
    def missing(*_):
        raise MissingExtraError("espeakng-loader", "voice", "the espeak-ng voice")

    monkeypatch.setattr(espeak, "spoken", missing)
    voice = Voice("raise", "raise")
    pcm, _ = await said(voice.enduring())
    assert not pcm.any() and len(pcm) == len(silence(TEXT)) >= SPEECH_RATE
    assert len(voice.complaints) == 1 and "pip install 'ico3d[voice]'" in voice.complaints[0]


@pytest.mark.parametrize("language", APOLOGIES)
def test_every_apology_can_be_spoken(language):
    assert set(APOLOGIES[language]) == set(APOLOGIES["en"])
    assert len(espeak.spoken(apology("voice", language), espeak_voice(language), 165)) > SPEECH_RATE


def test_unknown_languages_get_english():
    assert apology("language", "tlh") == APOLOGIES["en"]["language"]
    assert apology("language", "de-CH") == APOLOGIES["de"]["language"]
    assert espeak_voice("tlh") == "en-us" and espeak_voice("pt-BR") == "pt"
