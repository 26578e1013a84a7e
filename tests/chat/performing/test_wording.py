"""When the words of an answer are heard, as pages are told."""

import numpy as np
import pytest

from ico3d.chat.frames import SpeechFrame
from ico3d.chat.page import Page
from ico3d.chat.performing.wording import Wording, times_of
from ico3d.chat.wire.protocol import MAX_WORDS, SPEECH_RATE, Spoken

WORD, PAUSE = 0.3, 0.2


class Recorder(Page):
    def __init__(self):
        super().__init__()
        self.sent = []

    def send(self, message):
        self.sent.append(message)


def bursts(count: int) -> np.ndarray:
    """(S,) words of 0.3 s with pauses of 0.2 s behind them."""
    times = np.arange(round(WORD * SPEECH_RATE)) / SPEECH_RATE
    word = 0.5 * np.sin(2 * np.pi * 200 * times)
    return np.tile(np.concatenate([word, np.zeros(round(PAUSE * SPEECH_RATE))]), count)


@pytest.mark.parametrize(
    ("text", "starts"),
    [
        ("Three small gardens here.", [0, 6, 12, 20]),
        ("so – so, 🙂 so so", [0, 5, 11, 14]),
        ("好，好的。", [0, 2, 3]),
        ("はい、そう GPT", [0, 1, 3, 4, 6]),
    ],
)
def test_words_are_found_in_any_script(text, starts):
    found, times = times_of(text, bursts(len(starts)))
    assert found == starts
    assert times == sorted(times)


@pytest.mark.parametrize("text", ["sun sun sun sun", "好好好好"])
def test_words_begin_after_the_pauses_before_them(text):
    _, times = times_of(text, bursts(4))
    assert times == pytest.approx([i * (WORD + PAUSE) for i in range(4)], abs=0.04)


def test_nothing_is_timed_without_words_or_sound_and_never_too_much():
    assert times_of("… !", bursts(1)) == ([], [])
    assert times_of("Hello.", np.zeros(0)) == ([], [])
    starts, times = times_of("a " * 2 * MAX_WORDS, bursts(3))
    assert len(starts) == len(times) == MAX_WORDS and times == sorted(times)


def test_each_sentence_is_told_once_when_its_sound_is_complete():
    page = Recorder()
    wording = Wording(page)
    sound = np.int16(32767 * bursts(2))
    half, first = len(sound) // 2, 4800
    rows = np.zeros((1, 3), np.float32)
    wording.read(SpeechFrame(4, first, 0, sound[:half], rows, "sun sun."))
    assert page.sent == []
    wording.read(SpeechFrame(4, first + half, 0, sound[half:], rows, ends_sentence=True))
    (told,) = page.sent
    assert isinstance(told, Spoken)
    assert (told.utterance, told.first_sample, told.starts) == (4, first, [0, 4])
    assert told.times == pytest.approx([0.2, 0.2 + WORD + PAUSE], abs=0.04)
