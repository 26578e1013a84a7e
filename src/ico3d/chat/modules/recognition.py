"""`POST /v1/audio/transcriptions`: a WAV file in, its words out."""

import asyncio
import io
import wave
from typing import Annotated, Literal

import numpy as np
from fastapi import FastAPI, File, Form, Response, UploadFile
from fastapi.responses import JSONResponse, PlainTextResponse
from pipecat.frames.frames import (
    Frame,
    InputAudioRawFrame,
    TranscriptionFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)

from ico3d.chat.modules.headless import Spares, run
from ico3d.chat.protocol import MICROPHONE_CHUNK, MICROPHONE_RATE
from ico3d.errors import MissingExtraError, ProtocolError

LEAD_IN = 15  # chunks before speech is announced: a VAD is that late too
QUIET = np.zeros(MICROPHONE_RATE * 3 // 10, np.int16)  # around speech, as recognisers expect it
DTYPES = {1: np.uint8, 2: np.dtype("<i2"), 4: np.dtype("<i4")}  # by bytes of a WAV's samples


def add_routes(app: FastAPI, name: str, spares: Spares, seconds: float) -> None:
    """Adds the route.

    Args:
        app: Where to.
        name: Of the model; what clients call it is not looked at.
        spares: Makes recognisers.
        seconds: That a request may take.
    """

    @app.post("/v1/audio/transcriptions")
    async def transcriptions(
        file: Annotated[UploadFile, File()],
        response_format: Annotated[Literal["json", "text", "verbose_json"], Form()] = "json",
    ) -> Response:
        pcm = await asyncio.to_thread(read_wav, await file.read())
        made = run(await spares.take(), heard(pcm), seconds)
        said = [frame async for frame in made if isinstance(frame, TranscriptionFrame)]
        return _answer(said, len(pcm) / MICROPHONE_RATE, response_format)


def _answer(said: list[TranscriptionFrame], duration: float, form: str) -> Response:
    text = " ".join(frame.text.strip() for frame in said)
    if form == "text":
        return PlainTextResponse(text + "\n")
    if form == "json":
        return JSONResponse({"text": text})
    language = next((str(frame.language) for frame in said if frame.language), "")
    facts = {"task": "transcribe", "language": language, "duration": duration, "text": text}
    return JSONResponse(facts)


def heard(pcm: np.ndarray) -> list[Frame]:
    """(S,) int16 at 16 kHz as a conversation would bring it: one stretch of speech."""
    pcm = np.concatenate([QUIET, pcm, QUIET])
    starts = range(0, len(pcm), MICROPHONE_CHUNK)
    pieces = [pcm[at : at + MICROPHONE_CHUNK].tobytes() for at in starts]
    frames: list[Frame] = [InputAudioRawFrame(piece, MICROPHONE_RATE, 1) for piece in pieces]
    frames.insert(min(LEAD_IN, len(frames)), VADUserStartedSpeakingFrame())
    return [*frames, VADUserStoppedSpeakingFrame()]


def read_wav(data: bytes) -> np.ndarray:
    """A WAV file as (S,) int16 mono at 16 kHz.

    Raises:
        ProtocolError: If it is none, or has no sound.
        MissingExtraError: If soxr is needed and not installed.
    """
    try:
        with wave.open(io.BytesIO(data)) as file:
            width, channels, rate = file.getsampwidth(), file.getnchannels(), file.getframerate()
            raw = file.readframes(file.getnframes())
    except (wave.Error, EOFError) as error:
        raise ProtocolError(f"the file is no WAV file of PCM samples ({error}).") from None
    if width not in DTYPES:
        raise ProtocolError(f"the WAV file has samples of {8 * width} bits: use 16.")
    values = np.frombuffer(
        raw[: len(raw) // (width * channels) * (width * channels)], DTYPES[width]
    )
    if len(values) == 0:
        raise ProtocolError("the WAV file has no sound in it.")
    samples = values.reshape(-1, channels).mean(axis=1)  # (S,)
    samples = (samples - 128 if width == 1 else samples) / 256.0 ** (width - 2)
    if rate != MICROPHONE_RATE:
        samples = _resampled(samples, rate)
    return np.clip(np.round(samples), -32768, 32767).astype(np.int16)


def _resampled(samples: np.ndarray, rate: int) -> np.ndarray:
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "chat", "sound at another rate") from None
    return soxr.resample(samples, rate, MICROPHONE_RATE)
