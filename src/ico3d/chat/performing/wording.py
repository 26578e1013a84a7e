"""Tells the page when the words of the answer are heard."""

import re

import numpy as np

from ico3d.chat.frames import SpeechFrame
from ico3d.chat.page import Page
from ico3d.chat.wire.protocol import MAX_WORDS, SPEECH_RATE, Spoken
from ico3d.motion.composing.accents import loudness, timed_words

_IDEOGRAPH = re.compile(r"([\u3040-\u30ff\u3400-\u9fff][^\w\s]*)")
"""A character of a script that puts no spaces between words, with the punctuation behind it."""


class Wording:
    """Times the words of each sentence as soon as all of its sound has been made.

    The voices tell no times of words: they are estimated from text and loudness.
    """

    def __init__(self, page: Page):
        """Creates the wording of one session; `page` receives `Spoken`."""
        self._page = page
        self._text = ""
        self._first = 0
        self._sound: list[np.ndarray] = []

    def read(self, frame: SpeechFrame) -> None:
        """Takes the next piece of synthesised sound."""
        if frame.text is not None:
            self._text, self._first, self._sound = frame.text, frame.first_sample, []
        self._sound.append(frame.pcm)
        if frame.ends_sentence:
            self._tell(frame.utterance)

    def _tell(self, utterance: int) -> None:
        sound = np.concatenate(self._sound).astype(np.float32) / 32768  # (S,)
        self._sound = []
        starts, times = times_of(self._text, sound)
        if starts:
            begin = self._first / SPEECH_RATE
            times = [round(begin + time, 3) for time in times]
            self._page.send(Spoken(utterance, self._first, starts, times))


def times_of(text: str, sound: np.ndarray) -> tuple[list[int], list[float]]:
    """Where the words of a sentence start in its text and in its sound.

    Args:
        text: The sentence.
        sound: (S,) its sound in −1 … 1 at 24 kHz.

    Returns:
        Indices of the first characters, and seconds, of at most `MAX_WORDS` words.
    """
    levels = loudness(sound, SPEECH_RATE)
    words = timed_words(_IDEOGRAPH.sub(r" \1 ", text), levels, 0.0, len(sound) / SPEECH_RATE)
    starts, after = [], 0
    for word in words[:MAX_WORDS]:
        start = text.index(word.text, after)
        starts.append(start)
        after = start + len(word.text)
    return starts, [word.begin for word in words[:MAX_WORDS]]
