"""The voice of espeak-ng: offline, its library and voices are inside a package."""

import asyncio
from collections.abc import AsyncGenerator
from dataclasses import dataclass

import numpy as np
from pipecat.frames.frames import Frame, TTSAudioRawFrame
from pipecat.services.settings import TTSSettings
from pipecat.services.tts_service import TTSService

from ico3d.chat.protocol import SPEECH_RATE
from ico3d.chat.services.provider import Context
from ico3d.common.espeak import synthesize
from ico3d.errors import MissingExtraError

STARVED = 60.0  # s that a sentence may take on a machine that is busy with other things


@dataclass(frozen=True)
class Settings:
    """Which voice.

    Attributes:
        voice: espeak-ng's language and variant.
        rate: Words per minute.
    """

    voice: str = "en-us+f3"
    rate: int = 165


class EspeakVoice(TTSService):
    """Speaks a sentence in about 20 ms."""

    def __init__(self, voice: str, rate: int):
        """A voice such as `en-us+f3` at `rate` words per minute."""
        super().__init__(
            push_start_frame=True,
            push_stop_frames=True,
            stop_frame_timeout_s=STARVED,
            sample_rate=SPEECH_RATE,
            settings=TTSSettings(model=None, voice=voice, language=None),
        )
        self._voice, self._rate = voice, rate

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the sentence's sound in one frame."""
        pcm = await asyncio.to_thread(spoken, text, self._voice, self._rate)
        yield TTSAudioRawFrame(pcm.tobytes(), SPEECH_RATE, 1, context_id=context_id)


def spoken(text: str, voice: str, rate: int) -> np.ndarray:
    """A text as (S,) int16 samples at 24 kHz."""
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "chat", "the espeak-ng voice") from None
    speech = synthesize(text, voice, rate)
    samples = soxr.resample(speech.samples, speech.rate, SPEECH_RATE)  # (S,)
    return (np.clip(samples, -1, 1) * 32767).astype(np.int16)


def make(settings: Settings, context: Context) -> EspeakVoice:
    """A voice for one session.

    Raises:
        MissingExtraError: If espeakng-loader or soxr is not installed.
        SettingsError: If there is no such voice.
    """
    spoken("a", settings.voice, settings.rate)  # fails now rather than in mid-talk
    return EspeakVoice(settings.voice, settings.rate)
