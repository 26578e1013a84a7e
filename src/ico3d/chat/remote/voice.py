"""`POST /v1/audio/speech`: a text in, the sound out while it is synthesised."""

import contextlib
import struct
from collections.abc import AsyncGenerator
from typing import Literal

from fastapi import FastAPI, Request
from fastapi.responses import StreamingResponse
from pipecat.frames.frames import (
    AggregatedTextFrame,
    Frame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    TTSAudioRawFrame,
)
from pipecat.services.tts_service import TTSService
from pipecat.utils.text.base_text_aggregator import TextType
from pydantic import BaseModel, Field

from ico3d.chat.remote.asked import asked
from ico3d.chat.remote.headless import Spares, run
from ico3d.chat.services.voice.clauses import sentences_of
from ico3d.chat.services.voice.lasting import bound_sound
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import ServiceError

UNKNOWN = 0xFFFFFFFF  # length of a WAV file that is still being made


class SpeechRequest(BaseModel):
    """A text to speak; other fields, such as model and voice, are ignored: settings decide.

    Attributes:
        input: The text.
        response_format: `pcm`: raw PCM16 at 24 kHz; `wav`: a WAV file of the same.
        speed: Only 1 is supported.
    """

    input: str = Field(min_length=1, max_length=4096)
    response_format: Literal["pcm", "wav"] = "wav"
    speed: Literal[1] = 1


def add_routes(app: FastAPI, name: str, spares: Spares, seconds: float) -> None:
    """Adds the route to an application.

    Args:
        app: The application.
        name: Name of the model; the name in requests is ignored.
        spares: Creates voices.
        seconds: Time limit of a request.
    """

    @app.post("/v1/audio/speech")
    async def speech(sent: Request) -> StreamingResponse:
        request = await asked(sent, SpeechRequest)
        sound = spoken(request.input, spares, seconds)
        first = await anext(sound)  # an error is still an answer here
        is_wav = request.response_format == "wav"
        head = wav_header() if is_wav else b""
        media_type = "audio/wav" if is_wav else f"audio/L16; rate={SPEECH_RATE}; channels=1"
        return StreamingResponse(_joined(head + first, sound), media_type=media_type)


async def spoken(text: str, spares: Spares, seconds: float) -> AsyncGenerator[bytes, None]:
    """Yields the sound of a text as PCM16 at 24 kHz, sentence by sentence.

    Raises:
        ServiceError: If the voice fails, or produces no sound or far too much.
        TimeoutError: If the time limit is exceeded.
    """
    frames: list[Frame] = [LLMFullResponseStartFrame()]
    for sentence in await sentences_of(text):  # a voice would look at all of it for each letter
        frames.append(AggregatedTextFrame(text=sentence, text_type=TextType.SENTENCE))
    frames.append(LLMFullResponseEndFrame())
    silent, voice = True, await spares.take()
    if isinstance(voice, TTSService):
        bound_sound(voice)
    async with contextlib.aclosing(run(voice, frames, seconds)) as made:
        async for frame in made:
            if isinstance(frame, TTSAudioRawFrame) and frame.audio:
                silent = False
                yield frame.audio
    if silent:
        raise ServiceError("the voice gave no sound.")


async def _joined(head: bytes, sound: AsyncGenerator[bytes, None]) -> AsyncGenerator[bytes, None]:
    async with contextlib.aclosing(sound):
        yield head
        async for pcm in sound:
            yield pcm


def wav_header() -> bytes:
    """The header of a WAV file, PCM16 mono at 24 kHz, of unknown length."""
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, SPEECH_RATE, 2 * SPEECH_RATE, 2, 16)
    head = struct.pack("<4sI4s", b"RIFF", UNKNOWN, b"WAVE")
    return head + form + struct.pack("<4sI", b"data", UNKNOWN)
