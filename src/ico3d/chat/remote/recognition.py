"""`POST /v1/audio/transcriptions`: a WAV file in, the transcript out."""

import asyncio
import io
import wave
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from pipecat.frames.frames import (
    Frame,
    InputAudioRawFrame,
    TranscriptionFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from starlette.datastructures import UploadFile

from ico3d.chat.remote.asked import form_of
from ico3d.chat.remote.headless import Spares, run
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK, MICROPHONE_RATE
from ico3d.common.sound import REQUEST, WAV_ERRORS, fault, open_claim, open_wav
from ico3d.errors import ProtocolError
from ico3d.speech.mel import resampling_stream

LEAD_IN = 15  # chunks before speech is announced: a VAD is that late too
QUIET = np.zeros(MICROPHONE_RATE * 3 // 10, np.int16)  # around speech, as recognisers expect it
BLOCK = 1 << 14  # frames that are converted at once
FORMATS = ("json", "text", "verbose_json")
DTYPES = {1: np.uint8, 2: np.dtype("<i2"), 4: np.dtype("<i4")}  # by bytes of a WAV's samples


def add_routes(app: FastAPI, name: str, spares: Spares, seconds: float) -> None:
    """Adds the route to an application.

    Args:
        app: The application.
        name: Name of the model; the name in requests is ignored.
        spares: Creates recognisers.
        seconds: Time limit of a request.
    """

    @app.post("/v1/audio/transcriptions")
    async def transcriptions(sent: Request) -> Response:
        async with form_of(sent) as form:
            file, response_format = form.get("file"), form.get("response_format", "json")
            if not isinstance(file, UploadFile):
                raise ProtocolError("file: a file is required.")
            if response_format not in FORMATS:
                raise ProtocolError(f"response_format: must be one of {', '.join(FORMATS)}.")
            pcm = await asyncio.to_thread(read_wav, file.file)
        made = run(await spares.take(), heard(pcm), seconds)
        said = [frame async for frame in made if isinstance(frame, TranscriptionFrame)]
        return _answer(said, len(pcm) / MICROPHONE_RATE, str(response_format))


def _answer(said: list[TranscriptionFrame], duration: float, form: str) -> Response:
    text = " ".join(frame.text.strip() for frame in said)
    if form == "text":
        return PlainTextResponse(text + "\n")
    if form == "json":
        return JSONResponse({"text": text})
    language = next((str(frame.language) for frame in said if frame.language), "")
    facts = {"task": "transcribe", "language": language, "duration": duration, "text": text}
    return JSONResponse(facts)


def heard(pcm: np.ndarray) -> Iterator[Frame]:
    """Frames for samples (S,) int16 at 16 kHz, as in a conversation with one stretch of speech."""
    pcm = np.concatenate([QUIET, pcm, QUIET])
    for number, at in enumerate(range(0, len(pcm), MICROPHONE_CHUNK)):
        if number == LEAD_IN:
            yield VADUserStartedSpeakingFrame()
        yield InputAudioRawFrame(pcm[at : at + MICROPHONE_CHUNK].tobytes(), MICROPHONE_RATE, 1)
    yield VADUserStoppedSpeakingFrame()


def read_wav(file: BinaryIO) -> np.ndarray:
    """Reads a WAV file as (S,) int16 mono at 16 kHz, after checking what its header claims.

    Raises:
        ProtocolError: If the file is no WAV, is empty, or claims more than is accepted.
        MissingExtraError: If soxr is needed and not installed.
    """
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    try:
        with open_wav(file) as sound:
            pieces = list(_pieces(sound, size))
    except WAV_ERRORS as error:
        raise ProtocolError(f"the file is no WAV file of PCM samples ({error}).") from None
    pcm = np.concatenate(pieces)
    if len(pcm) == 0:
        raise ProtocolError("the WAV file has no sound in it.")
    return pcm


def _pieces(sound: wave.Wave_read, size: int) -> Iterator[np.ndarray]:
    """The (n,) int16 pieces of a sound of at most `size` bytes, mono at 16 kHz."""
    claim = open_claim(sound, size)
    if claim.width not in DTYPES:
        raise ProtocolError(f"the WAV file has samples of {8 * claim.width} bits: use 16.")
    wrong = fault(claim, REQUEST)
    if wrong:
        raise ProtocolError(f"the WAV file {wrong}.")
    convert = resampling_stream(claim.rate)
    one = claim.width * claim.channels  # bytes
    while raw := sound.readframes(BLOCK):
        whole = raw[: len(raw) // one * one]
        yield _int16(convert(_mono(whole, claim.width, claim.channels), False))
    yield _int16(convert(np.zeros(0, np.float32), True))


def _mono(raw: bytes, width: int, channels: int) -> np.ndarray:
    """Whole frames as (n,) samples in [-32768, 32768)."""
    samples = np.frombuffer(raw, DTYPES[width]).reshape(-1, channels).mean(axis=1)  # (n,)
    return (samples - 128 if width == 1 else samples) / 256.0 ** (width - 2)


def _int16(samples: np.ndarray) -> np.ndarray:
    return np.clip(np.round(samples), -32768, 32767).astype(np.int16)
