"""A voice that is one function from a text to its sound."""

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable
from typing import Any

import numpy as np
from pipecat.frames.frames import ErrorFrame, Frame, TTSAudioRawFrame
from pipecat.services.settings import TTSSettings
from pipecat.services.tts_service import TTSService

from ico3d.chat.pipecat_internals import mark_synchronous
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import MissingExtraError

STARVED = 60.0  # s that a sentence may take on a machine that is busy with other things
OPTIONS: dict[str, Any] = {
    "sample_rate": SPEECH_RATE,
    "stop_frame_timeout_s": STARVED,
    "max_consecutive_zero_audio_contexts": 0,  # a voice that failed may work again
}
"""What every voice tells pipecat's base."""
SYNCHRONOUS: dict[str, Any] = {"push_start_frame": True, "push_stop_frames": True}
"""What those tell it besides that leave it to mark where a piece begins and ends."""
LOADING = threading.Lock()
"""Held while models are loaded, so that visitors who come at once share them."""


class Prompt(TTSService):
    """A voice whose sound is complete when `run_tts` ends.

    pipecat knows that only of one that made sound, and would wait for one that met an error.
    """

    async def tts_process_generator(
        self, context_id: str, generator: AsyncGenerator[Frame | None, None]
    ) -> None:
        """Passes on what `run_tts` yields."""
        await super().tts_process_generator(context_id, generator)
        mark_synchronous(self)


class PieceVoice(Prompt):
    """Speaks piece by piece, in a thread, with what `speak` makes of a text."""

    def __init__(self, voice: str, speak: Callable[[str], np.ndarray]):
        """For one session.

        Args:
            voice: Name of the voice.
            speak: A text as (S,) int16 samples at 24 kHz; called from threads.
        """
        super().__init__(
            settings=TTSSettings(model=None, voice=voice, language=None),
            **SYNCHRONOUS,
            **OPTIONS,
        )
        self._speak = speak

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the text's sound in one frame, or the error that it met."""
        try:
            pcm = await asyncio.to_thread(self._speak, text)
        except Exception as error:
            yield ErrorFrame(f"a sentence could not be spoken: {error}", exception=error)
            return
        yield TTSAudioRawFrame(pcm.tobytes(), SPEECH_RATE, 1, context_id=context_id)


def at_speech_rate(samples: np.ndarray, rate: int) -> np.ndarray:
    """A whole piece as (S,) int16 at 24 kHz, from (S,) floats in [-1, 1] at another rate.

    Raises:
        MissingExtraError: If soxr is not installed.
    """
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "chat", "a voice") from None
    resampled = soxr.resample(np.asarray(samples, np.float32), rate, SPEECH_RATE)  # (S,)
    return (np.clip(resampled, -1, 1) * 32767).astype(np.int16)
