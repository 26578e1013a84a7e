"""Words and loudness of an utterance over time, as far as it has been synthesised."""

import numpy as np

from ico3d.chat.frames import SpeechFrame
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.motion.composing.accents import GrowingLoudness, Word, timed_words
from ico3d.rig.quaternions import Array


class Script:
    """Words and loudness of one utterance; the words of a sentence are added with its sound."""

    def __init__(self):
        """Starts empty."""
        self.words: tuple[Word, ...] = ()
        self.complete = False
        self.seconds = 0.0
        self._loudness = GrowingLoudness(SPEECH_RATE)
        self._sentence: tuple[str, float] | None = None  # its text and when it begins

    @property
    def levels(self) -> Array:
        """Loudness from the beginning of the utterance."""
        return self._loudness.levels

    def add(self, frame: SpeechFrame) -> None:
        """Adds the next piece of sound."""
        if frame.text is not None:
            self._end_sentence()
            self._sentence = frame.text, frame.first_sample / SPEECH_RATE
        self._loudness.push(np.asarray(frame.pcm, float) / 32768)
        self.seconds = (frame.first_sample + len(frame.pcm)) / SPEECH_RATE

    def end(self) -> None:
        """Marks the utterance as complete."""
        self._end_sentence()
        self.complete = True

    def _end_sentence(self) -> None:
        if self._sentence is None:
            return
        (text, begin), self._sentence = self._sentence, None
        self.words += timed_words(text, self.levels, begin, self.seconds)
