"""`POST /v1/audio/speech`: a text in, its sound out while it is made."""

import contextlib
import struct
from collections.abc import AsyncGenerator
from typing import Literal

from fastapi import FastAPI
from fastapi.responses import StreamingResponse
from pipecat.frames.frames import (
    Frame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TTSAudioRawFrame,
)
from pydantic import BaseModel, Field

from ico3d.chat.remote.headless import Spares, run
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import ServiceError

UNKNOWN = 0xFFFFFFFF  # length of a WAV file that is still being made


class SpeechRequest(BaseModel):
    """What is to be said; model, voice and further fields are not looked at: settings choose.

    Attributes:
        input: The text.
        response_format: Raw PCM16 at 24 kHz, or a WAV file of it.
        speed: Only 1 is known.
    """

    input: str = Field(min_length=1, max_length=4096)
    response_format: Literal["pcm", "wav"] = "wav"
    speed: Literal[1] = 1


def add_routes(app: FastAPI, name: str, spares: Spares, seconds: float) -> None:
    """Adds the route.

    Args:
        app: Where to.
        name: Of the model; what clients call it is not looked at.
        spares: Makes voices.
        seconds: That a request may take.
    """

    @app.post("/v1/audio/speech")
    async def speech(request: SpeechRequest) -> StreamingResponse:
        sound = spoken(request.input, spares, seconds)
        first = await anext(sound)  # an error is still an answer here
        is_wav = request.response_format == "wav"
        head = wav_header() if is_wav else b""
        media_type = "audio/wav" if is_wav else f"audio/L16; rate={SPEECH_RATE}; channels=1"
        return StreamingResponse(_joined(head + first, sound), media_type=media_type)


async def spoken(text: str, spares: Spares, seconds: float) -> AsyncGenerator[bytes, None]:
    """PCM16 at 24 kHz of a text, sentence by sentence.

    Raises:
        ServiceError: If the voice fails or gives no sound.
        TimeoutError: If it takes too long.
    """
    frames: list[Frame] = [
        LLMFullResponseStartFrame(),
        LLMTextFrame(text),
        LLMFullResponseEndFrame(),
    ]
    silent = True
    async with contextlib.aclosing(run(await spares.take(), frames, seconds)) as made:
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
    """Of PCM16 mono at 24 kHz whose length is not known yet."""
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, SPEECH_RATE, 2 * SPEECH_RATE, 2, 16)
    head = struct.pack("<4sI4s", b"RIFF", UNKNOWN, b"WAVE")
    return head + form + struct.pack("<4sI", b"data", UNKNOWN)
