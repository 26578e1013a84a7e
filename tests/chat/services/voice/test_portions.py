"""Texts in portions that are spoken one after the other."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pipecat.frames.frames import ErrorFrame, TTSAudioRawFrame

from ico3d.chat.frames import PhonemesFrame
from ico3d.chat.services.voice.base import PieceVoice, Spoken
from ico3d.chat.services.voice.lasting import Lasting
from ico3d.chat.services.voice.portions import MOST, parted, portions
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.espeak.speech import Phoneme

SENTENCE = "It was a bright cold day in April, and the clocks were striking thirteen."


@pytest.mark.parametrize(
    ("text", "cut"),
    [
        ("", []),
        (SENTENCE, [SENTENCE]),
        ("a" * MOST, ["a" * MOST]),
        ("a" * (MOST + 1), ["a" * MOST, "a"]),
        ("word " * 41, ["word " * 40, "word "]),
        ("b" * 150 + " " + "c" * 100, ["b" * 150 + " ", "c" * 100]),
        ("ﷺ" * 25, ["ﷺ" * 11, "ﷺ" * 11, "ﷺ" * 3]),
        ("龍" * 70, ["龍" * 66, "龍" * 4]),
        ("⠿" * 20, ["⠿" * 16, "⠿" * 4]),
        ("≤" * 20, ["≤" * 16, "≤" * 4]),
        ("7" * 30, ["7" * 25, "7" * 5]),
        ("w" * 30, ["w" * 25, "w" * 5]),
        ("owl " * 51, ["owl " * 50, "owl "]),
    ],
)
def test_a_text_is_cut_between_words(text, cut):
    assert list(portions(text)) == cut


@given(st.text(max_size=1000) | st.text("ab ﷺ\n", max_size=1000))
def test_nothing_is_lost_and_no_portion_is_long(text):
    found = list(portions(text))
    assert "".join(found) == text
    assert all(0 < len(portion) <= MOST for portion in found)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (SENTENCE, SENTENCE),
        ("s'" * 40, "s'" * 32 + " " + "s'" * 8),
        ("ness" * 33, " ".join(["ness" * 16] * 2 + ["ness"])),
        ("b" * 64, "b" * 64),
        ("你好" * 90, "你好" * 90),
        ("s′" * 40, "s′" * 32 + " " + "s′" * 8),
        ("'s?" * 22, "'s?" * 21 + "' " + "s?"),
        ("x-" * 90, " ".join(["x-" * 32] * 2 + ["x-" * 26])),
    ],
)
def test_no_word_is_endless(text, parts):
    assert parted(text) == parts


async def test_every_voice_gets_words_that_end():
    asked = []

    async def speak(text, context_id):
        asked.append(text)
        yield TTSAudioRawFrame(bytes(480), SPEECH_RATE, 1)

    [_ async for _ in Lasting(speak).run_tts("'s" * 90, "answer")]
    assert asked == [parted("'s" * 90)]


async def test_a_voice_speaks_portion_by_portion_and_stops_between_them():
    asked = []

    def speak(text):
        asked.append(text)
        return Spoken(np.zeros(SPEECH_RATE, np.int16), (Phoneme(0.0, "a"),))

    voice = PieceVoice("any", speak)
    frames = [frame async for frame in voice.run_tts("ﷺ" * 25, "answer")]
    assert asked == ["ﷺ" * 11, "ﷺ" * 11, "ﷺ" * 3], "others may speak between them"
    assert [type(frame) for frame in frames] == 3 * [PhonemesFrame, TTSAudioRawFrame]

    asked.clear()
    async with contextlib.aclosing(voice.run_tts("ﷺ" * 1000, "answer")) as sound:
        async for frame in sound:
            if isinstance(frame, TTSAudioRawFrame):
                break
    assert asked == ["ﷺ" * 11], "who is interrupted speaks no further"


async def test_sound_that_is_too_long_is_not_made_to_its_end():
    asked = []

    def speak(text):
        asked.append(text)
        return Spoken(np.zeros(500 * SPEECH_RATE, np.int16))

    lasting = Lasting(PieceVoice("any", speak).run_tts)
    frames = [frame async for frame in lasting.run_tts("ﷺ" * 1000, "answer")]
    assert isinstance(frames[-1], ErrorFrame)
    assert len(asked) == 3, "1,200 seconds and no more"
