"""A voice that is a single function from text to sound."""

import asyncio
import os
import threading
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pipecat.frames.frames import ErrorFrame, Frame, TTSAudioRawFrame
from pipecat.services.settings import TTSSettings
from pipecat.services.tts_service import TTSService

from ico3d.chat.frames import PhonemesFrame
from ico3d.chat.pipecat_internals import mark_synchronous
from ico3d.chat.services.voice.portions import portions
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.espeak.speech import Phoneme
from ico3d.errors import MissingExtraError

STARVED = 60.0  # s that a sentence may take on a machine that is busy with other things
OPTIONS: dict[str, Any] = {
    "sample_rate": SPEECH_RATE,
    "stop_frame_timeout_s": STARVED,
    "max_consecutive_zero_audio_contexts": 0,  # a voice that failed may work again
}
"""Options of pipecat's base class that are the same for all voices."""
SYNCHRONOUS: dict[str, Any] = {"push_start_frame": True, "push_stop_frames": True}
"""Further options for voices that leave it to pipecat to mark the ends of pieces."""
LOADING = threading.Lock()
"""Lock that is held while models are loaded, so that simultaneous visitors share them."""


class Prompt(TTSService):
    """A voice whose sound is complete when `run_tts` ends.

    pipecat assumes that only if the voice made sound, and would wait after an error.
    """

    async def tts_process_generator(
        self, context_id: str, generator: AsyncGenerator[Frame | None, None]
    ) -> None:
        """Passes on the frames of `run_tts`."""
        await super().tts_process_generator(context_id, generator)
        mark_synchronous(self)


@dataclass(frozen=True)
class Spoken:
    """A text that was spoken.

    Attributes:
        pcm: The sound, (S,) int16 at 24 kHz.
        phonemes: The speech sounds with their times; empty if the voice does not know them.
    """

    pcm: np.ndarray
    phonemes: tuple[Phoneme, ...] = ()


class PieceVoice(Prompt):
    """Speaks each piece of an answer by calling a function in a thread."""

    def __init__(self, voice: str, speak: Callable[[str], Spoken]):
        """Creates the voice of one session.

        Args:
            voice: Name of the voice.
            speak: Speaks a text; called from threads.
        """
        super().__init__(
            settings=TTSSettings(model=None, voice=voice, language=None),
            **SYNCHRONOUS,
            **OPTIONS,
        )
        self._speak = speak

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the speech sounds of each portion of a text and its sound, or an error."""
        for portion in portions(text):
            try:
                async with _turn():
                    spoken = await asyncio.to_thread(self._speak, portion)
            except Exception as error:
                yield ErrorFrame(f"a sentence could not be spoken: {error}", exception=error)
                return
            if spoken.phonemes:
                yield PhonemesFrame(spoken.phonemes, len(spoken.pcm) / SPEECH_RATE, context_id)
            yield TTSAudioRawFrame(spoken.pcm.tobytes(), SPEECH_RATE, 1, context_id=context_id)


def _turn() -> asyncio.Semaphore:
    """What admits as many portions at a time as there are cores, of all sessions of a loop.

    Whoever is interrupted while it waits is gone from the line. In a thread it would go on waiting,
    with the threads that all sessions share.
    """
    loop = asyncio.get_running_loop()
    return _turns.setdefault(loop, asyncio.Semaphore(os.cpu_count() or 1))


_turns: WeakKeyDictionary[asyncio.AbstractEventLoop, asyncio.Semaphore] = WeakKeyDictionary()


def at_speech_rate(samples: np.ndarray, rate: int) -> np.ndarray:
    """Converts samples (S,) in [-1, 1] at another rate to (S,) int16 at 24 kHz.

    Raises:
        MissingExtraError: If soxr is not installed.
    """
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "chat", "a voice") from None
    resampled = soxr.resample(np.asarray(samples, np.float32), rate, SPEECH_RATE)  # (S,)
    return (np.clip(resampled, -1, 1) * 32767).astype(np.int16)
