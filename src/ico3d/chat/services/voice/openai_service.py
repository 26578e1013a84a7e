"""pipecat's OpenAI voice, for any sample rate and with short first pieces; slow to import."""

from collections.abc import AsyncGenerator, AsyncIterator
from dataclasses import replace

from pipecat.audio.utils import create_stream_resampler
from pipecat.frames.frames import ErrorFrame, Frame, TTSAudioRawFrame
from pipecat.services.openai.tts import OpenAITTSService

from ico3d.chat.pipecat_internals import audio_frames, client_of, use_resampler
from ico3d.chat.services.client import client_options
from ico3d.chat.services.voice.base import OPTIONS, Prompt
from ico3d.chat.services.voice.openai_settings import WHERE, Settings
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.sound import REQUEST, Claim, fault, wav_claim
from ico3d.errors import ServiceError

CHUNK = 4800  # bytes that are passed on at once: 0.1 s


class ServerVoice(Prompt, OpenAITTSService):
    """pipecat's OpenAI voice, for any voice name and sample rate, with short first pieces."""

    def __init__(self, settings: Settings):
        """Creates the voice of one session."""
        where = (settings.url, settings.key_variable, WHERE)
        super().__init__(
            **client_options(*where, timeout=settings.timeout),
            settings=OpenAITTSService.Settings(model=settings.model, voice=settings.voice),
            **OPTIONS,
        )
        client_of(self).max_retries = 1
        self._options = settings
        self._continuous = create_stream_resampler(clear_after_secs=None)  # servers make pauses
        use_resampler(self, self._continuous)

    async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame, None]:
        """Yields the sound while it arrives, or the server's error."""
        await self._continuous.reset()  # the piece before may have been interrupted
        options = self._options
        request = client_of(self).audio.speech.with_streaming_response.create(
            input=text, model=options.model, voice=options.voice, response_format="pcm"
        )
        try:
            async with request as response:
                rate = self._rate_of(response.headers.get("content-type", ""))
                async for frame in audio_frames(
                    self,
                    judged(response.iter_bytes(CHUNK), rate or SPEECH_RATE),
                    strip_wav_header=True,
                    in_sample_rate=rate,
                    context_id=context_id,
                ):
                    yield frame
        except Exception as error:
            where = client_of(self).base_url
            yield ErrorFrame(f"the voice server {where} did not speak: {error}", exception=error)
        if rest := await self._continuous.flush():
            yield TTSAudioRawFrame(rest, SPEECH_RATE, 1, context_id=context_id)

    async def cleanup(self) -> None:
        """Closes the connections."""
        await super().cleanup()
        await client_of(self).close()

    def _rate_of(self, content_type: str) -> int | None:
        """Null for sound whose header tells it."""
        return None if "wav" in content_type else self._options.rate


async def judged(sound: AsyncIterator[bytes], rate: int) -> AsyncIterator[bytes]:
    """Yields the pieces of a server's answer as long as they are acceptable sound.

    Args:
        sound: PCM16, with or without the header of a WAV file.
        rate: Samples per second, unless a header says otherwise.

    Raises:
        ServiceError: If a header claims more than is accepted or cannot be read, or the sound does
            not end in time.
    """
    claim, frames, headed = Claim(rate, width=2), 0, False
    async for piece in sound:
        # The pipeline takes the first piece that begins so for a header, wherever it comes.
        if not headed and piece.startswith(b"RIFF"):
            headed, told = True, wav_claim(piece)
            if told is None:
                raise ServiceError("its sound has no plain WAV header")
            claim = told
        frames += len(piece) // 2
        wrong = fault(replace(claim, frames=frames), REQUEST)
        if not wrong and (claim.channels, claim.width) != (1, 2):
            wrong = "is not mono with 16 bits"
        if wrong:
            raise ServiceError(f"its sound {wrong}")
        yield piece
