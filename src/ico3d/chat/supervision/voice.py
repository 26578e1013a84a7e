"""Makes sure that no sentence stays without sound when a voice fails.

A voice gets a time limit, as much sound as its text may need, and a second attempt. After that,
another voice apologises, and the answer is shown as captions only.
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Callable

import numpy as np
from pipecat.frames.frames import ErrorFrame, Frame, TTSAudioRawFrame
from pipecat.services.tts_service import TTSService
from pipecat.utils.errors import ErrorCategory

from ico3d.chat.observing.failures import ReportedError
from ico3d.chat.pipecat_internals import replace_run_tts
from ico3d.chat.services.voice import espeak
from ico3d.chat.services.voice.lasting import Lasting, Speak
from ico3d.chat.supervision.apologies import apology, espeak_voice
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import Ico3dError, ServiceError

TRIES = 2
RATE = espeak.Settings().rate
READING = 15.0  # letters per second that a reader takes in
SHORTEST, LONGEST = 1.0, 12.0  # s that a caption without a voice stays


class LateError(ServiceError):
    """A voice has exceeded its time limit."""


class EnduringVoice:
    """Wraps a voice's `run_tts`, which pipecat calls for every sentence."""

    def __init__(
        self, speak: Speak, patience: float, language: str, complain: Callable[[str], None]
    ):
        """Creates the wrapper for one session.

        Args:
            speak: The voice's own `run_tts`.
            patience: Time limit in seconds for a sentence's first sound, and between two pieces of
                it.
            language: Language code of the apology.
            complain: Receives the reason if not even the apology can be spoken.
        """
        self._speak, self._patience = Lasting(speak).run_tts, patience
        self._language, self._complain = language, complain
        self._lost = ""  # the answer whose apology has been said

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the sound of a sentence: the voice's, or a replacement."""
        if context_id == self._lost:
            yield _sound(silence(text), context_id)
            return
        heard, reason = False, Exception()
        for _ in range(TRIES):
            try:
                async with contextlib.aclosing(self._patient(text, context_id)) as sound:
                    async for frame in sound:
                        heard = heard or isinstance(frame, TTSAudioRawFrame)
                        yield frame
                return
            except Exception as error:
                reason = error
                if heard or isinstance(error, LateError):
                    break  # half a sentence is not said twice, and nobody waits twice
        self._lost = context_id
        unknown = ErrorCategory.UNKNOWN  # others would end the voice for good
        yield ErrorFrame(f"the voice failed: {reason}", exception=reason, category=unknown)
        yield _sound(await asyncio.to_thread(self._apology, text), context_id)

    async def _patient(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """The voice's frames.

        Raises:
            ServiceError: If the voice reports an error or gives no sound.
            LateError: If it takes too long.
        """
        silent = True
        async with contextlib.aclosing(self._speak(text, context_id)) as sound:
            while True:
                try:
                    async with asyncio.timeout(self._patience):
                        frame = await anext(sound)
                except StopAsyncIteration:
                    break
                except TimeoutError:
                    raise LateError(f"it gave no sound for {self._patience:g} s") from None
                if isinstance(frame, ErrorFrame):
                    raise ReportedError(frame.error) from frame.exception
                # without a frame, the sound comes later and by another way
                silent = silent and frame is not None and not isinstance(frame, TTSAudioRawFrame)
                yield frame
        if silent:
            raise ServiceError("it gave no sound")

    def _apology(self, text: str) -> np.ndarray:
        try:
            words = apology("voice", self._language)
            spoken = espeak.spoken(words, espeak_voice(self._language), RATE)
        except Ico3dError as error:
            self._complain(str(error))
            return silence(text)
        missing = len(silence(text)) - len(spoken)
        return np.pad(spoken, (0, max(0, missing)))  # the caption stays until it is read


def endure(
    voice: TTSService, patience: float, language: str, complain: Callable[[str], None]
) -> None:
    """Wraps a voice in an `EnduringVoice` by replacing `run_tts`; pipecat has no hook for that."""
    enduring = EnduringVoice(voice.run_tts, patience, language, complain)
    replace_run_tts(voice, enduring.run_tts)


def silence(text: str) -> np.ndarray:
    """Silence for the time that it takes to read a text, (S,) int16 at 24 kHz."""
    seconds = float(np.clip(len(text) / READING, SHORTEST, LONGEST))
    return np.zeros(int(seconds * SPEECH_RATE), np.int16)


def _sound(pcm: np.ndarray, context_id: str) -> TTSAudioRawFrame:
    return TTSAudioRawFrame(pcm.tobytes(), SPEECH_RATE, 1, context_id=context_id)
