"""Services with set delays, so that all other time of a conversation is the server's own.

They recognise, think and speak nothing. They serve timing and load tests of the server, also on
machines where the real services are slow or missing.
"""

import asyncio
import itertools
from collections.abc import AsyncGenerator, Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Literal

import numpy as np
from pipecat.frames.frames import (
    DataFrame,
    Frame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TranscriptionFrame,
    TTSAudioRawFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.services.settings import STTSettings, TTSSettings
from pipecat.services.stt_service import STTService
from pipecat.services.tts_service import TTSService
from pipecat.utils.time import time_now_iso8601

from ico3d.chat.services import Chosen, ChosenService
from ico3d.chat.services.provider import Context, Provider
from ico3d.chat.wire.protocol import SPEECH_RATE

SLOWEST = 10.0  # s that pipecat waits for words or for sound
NEVER = 3600.0  # s for which a service that hangs says nothing

Fault = Literal["language dies", "language hangs", "voice dies", "voice hangs"]
""""dies" breaks off halfway through the answer or the clause, "hangs" stays silent from there."""


@dataclass(frozen=True)
class Script:
    """What recogniser, language model and voice do.

    Attributes:
        recognition: Seconds from the detected end of speech to the transcript.
        language: Seconds from a question to the first word of the answer.
        voice: Seconds from a clause to the first sound.
        heard: Transcript of every question.
        answer: Answer to every question.
        seconds: Duration of each clause's sound in seconds.
        pitch: Frequency of the voice's tone, Hz.
        apart: Hz by which the tone rises from one session to the next.
        faults: What goes wrong with the answer to a question, by the question's text.
    """

    recognition: float = 0.1
    language: float = 0.15
    voice: float = 0.1
    heard: str = "what shall I ask"
    answer: str = "This answer is as good as any other."
    seconds: float = 2.0
    pitch: float = 220.0
    apart: float = 0.0
    faults: Mapping[str, Fault] = field(default_factory=dict)

    def delay(self) -> float:
        """Sum of the three delays in seconds."""
        return self.recognition + self.language + self.voice

    def services(self) -> Chosen:
        """The three services, as a conversation takes them."""
        pitches = itertools.count(self.pitch, self.apart)

        def voice(script: Script, _: Context) -> FrameProcessor:
            return Voice(replace(script, pitch=next(pitches)))

        makes = (partial(made, Recognition), partial(made, Language), voice)
        return Chosen(*(ChosenService(Provider("scripted", Script, make), self) for make in makes))


class Recognition(STTService):
    """A recogniser that returns the same words for every sound."""

    def __init__(self, script: Script):
        """Creates the recogniser of one session."""
        settings = STTSettings(model="scripted", language=None)
        super().__init__(ttfs_p99_latency=SLOWEST, settings=settings)
        self._script = script

    async def run_stt(self, audio: bytes) -> AsyncGenerator[Frame | None, None]:
        """Yields nothing: the transcript comes after the end of speech."""
        yield None

    async def _handle_vad_user_stopped_speaking(self, frame: VADUserStoppedSpeakingFrame):
        await super()._handle_vad_user_stopped_speaking(frame)
        self.create_task(self._tell())

    async def _tell(self) -> None:
        await asyncio.sleep(self._script.recognition)
        words = TranscriptionFrame(self._script.heard, "", time_now_iso8601(), finalized=True)
        await self.push_frame(words)


class BrokenError(Exception):
    """A service broke off, as its script says."""


@dataclass
class FaultyFrame(DataFrame):
    """Tells the voice what goes wrong with the answer that follows.

    Attributes:
        fault: What goes wrong; None for nothing.
    """

    fault: Fault | None = None


class Language(FrameProcessor):
    """A language model that gives the same answer to every question, word by word."""

    def __init__(self, script: Script):
        """Creates the language model of one session."""
        super().__init__()
        self._script = script

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Answers frames with a context and passes all other frames on."""
        await super().process_frame(frame, direction)
        if not isinstance(frame, LLMContextFrame):
            await self.push_frame(frame, direction)
            return
        fault = self._script.faults.get(asked(frame))
        await self.push_frame(FaultyFrame(fault))
        await self.push_frame(LLMFullResponseStartFrame())
        await asyncio.sleep(self._script.language)
        try:
            await self._answer(fault)
        except BrokenError as error:
            await self.push_error(str(error), exception=error)
        await self.push_frame(LLMFullResponseEndFrame())

    async def _answer(self, fault: Fault | None) -> None:
        words = self._script.answer.split()
        for place, word in enumerate(words):
            if 2 * place >= len(words):
                await fail(fault, "language")
            await self.push_frame(LLMTextFrame(word + " "))


class Voice(TTSService):
    """A voice that hums one tone."""

    def __init__(self, script: Script):
        """Creates the voice of one session."""
        super().__init__(
            push_start_frame=True,
            push_stop_frames=True,
            stop_frame_timeout_s=SLOWEST,
            sample_rate=SPEECH_RATE,
            settings=TTSSettings(model=None, voice="scripted", language=None),
        )
        self._script = script
        self._fault: Fault | None = None

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Learns what goes wrong with the next answer."""
        if isinstance(frame, FaultyFrame):
            self._fault = frame.fault
        await super().process_frame(frame, direction)

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame | None, None]:
        """Yields the sound of a clause in one frame, or the half of it before a fault."""
        await asyncio.sleep(self._script.voice)
        sound = tone(self._script.pitch, self._script.seconds)
        if self._fault in ("voice dies", "voice hangs"):
            half = sound[: len(sound) // 2].tobytes()
            yield TTSAudioRawFrame(half, SPEECH_RATE, 1, context_id=context_id)
            await fail(self._fault, "voice")
        yield TTSAudioRawFrame(sound.tobytes(), SPEECH_RATE, 1, context_id=context_id)


async def fail(fault: Fault | None, service: str) -> None:
    """Lets a service fail, if the fault is its own.

    Raises:
        BrokenError: If the service dies.
    """
    if fault == f"{service} hangs":
        await asyncio.sleep(NEVER)
    if fault == f"{service} dies":
        raise BrokenError("the connection broke off")


def asked(frame: LLMContextFrame) -> str:
    """The question that a language model is to answer; empty if there is none."""
    for message in reversed(frame.context.get_messages()):
        if isinstance(message, dict) and message.get("role") == "user":
            return str(message.get("content", ""))
    return ""


@lru_cache(maxsize=256)
def tone(pitch: float, seconds: float) -> np.ndarray:
    """A tone of `pitch` Hz, (S,) int16 at 24 kHz; the same array for the same tone."""
    times = np.arange(int(seconds * SPEECH_RATE)) / SPEECH_RATE
    return (8000 * np.sin(2 * np.pi * pitch * times)).astype(np.int16)


def made(kind: Callable[[Script], FrameProcessor], script: Script, _: Context) -> FrameProcessor:
    """Creates one of the three services for one session."""
    return kind(script)
