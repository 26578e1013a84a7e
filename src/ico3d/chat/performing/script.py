"""What an utterance says, word by word, and how loudly, as far as it has been made."""

import numpy as np

from ico3d.chat.frames import SpeechFrame
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.motion.composing.accents import GrowingLoudness, Word, timed_words
from ico3d.rig.quaternions import Array


class Script:
    """One utterance; words are known as soon as their sentence has been made."""

    def __init__(self):
        """Nothing has been made yet."""
        self.words: tuple[Word, ...] = ()
        self.complete = False
        self.seconds = 0.0
        self._loudness = GrowingLoudness(SPEECH_RATE)
        self._sentence: tuple[str, float] | None = None  # its text and when it begins

    @property
    def levels(self) -> Array:
        """Loudness from the beginning."""
        return self._loudness.levels

    def add(self, frame: SpeechFrame) -> None:
        """Takes the next piece of sound."""
        if frame.text is not None:
            self._end_sentence()
            self._sentence = frame.text, frame.first_sample / SPEECH_RATE
        self._loudness.push(np.asarray(frame.pcm, float) / 32768)
        self.seconds = (frame.first_sample + len(frame.pcm)) / SPEECH_RATE

    def end(self) -> None:
        """All has been made."""
        self._end_sentence()
        self.complete = True

    def _end_sentence(self) -> None:
        if self._sentence is None:
            return
        (text, begin), self._sentence = self._sentence, None
        self.words += timed_words(text, self.levels, begin, self.seconds)
