"""pipecat's OpenAI recogniser with any language and a time limit; slow to import."""

import asyncio
from collections.abc import AsyncGenerator
from typing import Any

from openai import OpenAIError
from pipecat.frames.frames import Frame, TranscriptionFrame
from pipecat.services.openai.stt import OpenAISTTService
from pipecat.utils.time import time_now_iso8601

from ico3d.chat.pipecat_internals import client_of
from ico3d.chat.services.client import client_options
from ico3d.chat.services.recognition.openai_settings import WHERE, Settings
from ico3d.chat.services.recognition.segments import Segments
from ico3d.chat.wire.characters import sendable

MOST_BYTES = 64 << 10
"""Of an answer: nobody says more in five minutes, and longer ones hold everybody up."""


class Transcriptions(OpenAISTTService):
    """Requests transcripts with the options of ico3d's settings.

    pipecat's own requests need a language, and let the client wait ten minutes, three times.
    """

    def __init__(self, options: Settings, **rest):
        """Creates a client of the server in the settings."""
        super().__init__(
            **client_options(options.url, options.key_variable, WHERE, MOST_BYTES),
            settings=OpenAISTTService.Settings(model=options.model),
            **rest,
        )
        self._options = options
        client_of(self).max_retries = 1

    async def run_stt(self, audio: bytes) -> AsyncGenerator[Frame, None]:
        """Transcribes a WAV file.

        Raises:
            ConnectionError: If no transcript arrives in time.
        """
        options = self._options
        place = options.url or "OpenAI's server"
        wanted: dict[str, Any] = {"language": options.language} if options.language else {}
        file = ("speech.wav", audio, "audio/wav")
        try:
            async with asyncio.timeout(options.timeout):
                answer = await client_of(self).audio.transcriptions.create(
                    file=file, model=options.model, **wanted
                )
        except TimeoutError:
            sentence = f"{place} gave no transcript within {options.timeout:g} s."
            raise ConnectionError(sentence) from None
        except OpenAIError as error:
            raise ConnectionError(f"{place} gave no transcript: {error}") from error
        yield TranscriptionFrame(sendable(answer.text), "", time_now_iso8601(), result=answer)


class OpenAIRecognition(Segments, Transcriptions):
    """The recogniser of one session, on an OpenAI-compatible server."""

    def __init__(self, options: Settings):
        """Creates the recogniser."""
        super().__init__(options.timeout, options.longest_speech, options=options)
