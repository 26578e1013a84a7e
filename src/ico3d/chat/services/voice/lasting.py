"""How long the sound of a text may be: all of it is kept until it has been played."""

import contextlib
from collections.abc import AsyncGenerator, Callable

from pipecat.frames.frames import ErrorFrame, Frame, TTSAudioRawFrame
from pipecat.services.tts_service import TTSService

from ico3d.chat.pipecat_internals import replace_run_tts
from ico3d.chat.services.voice.portions import parted

LETTER, LEAST = 2.0, 20.0
"""Seconds of sound for each letter of a piece, and for a piece however short.

Slow voices read a digit in more than a second.
"""
MOST = 1200.0  # s of sound of an answer: 4,000 letters of Chinese take less

Speak = Callable[[str, str], AsyncGenerator[Frame | None, None]]


class Lasting:
    """Wraps a voice's `run_tts`: no endless words go in, and no endless sound comes out."""

    def __init__(self, speak: Speak):
        """Takes the voice's own `run_tts`."""
        self._speak = speak
        self._answer, self._left = "", MOST

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the frames of a piece of an answer; an error in place of too much sound."""
        if context_id != self._answer:
            self._answer, self._left = context_id, MOST
        most = min(self._left, max(LEAST, LETTER * len(text)))
        seconds = 0.0
        if most > 0:  # else the voice is not even asked
            async with contextlib.aclosing(self._speak(parted(text), context_id)) as sound:
                async for frame in sound:
                    seconds += duration(frame)
                    if seconds > most:
                        break
                    yield frame
        self._left -= seconds
        if seconds > most or most <= 0:
            yield ErrorFrame("its sound is much longer than the text.")


def bound_sound(voice: TTSService) -> None:
    """Has a voice make no more sound than its texts need."""
    replace_run_tts(voice, Lasting(voice.run_tts).run_tts)


def duration(frame: Frame | None) -> float:
    """Seconds of sound in a frame."""
    if not isinstance(frame, TTSAudioRawFrame):
        return 0.0
    return len(frame.audio) / (2 * frame.num_channels * frame.sample_rate)
