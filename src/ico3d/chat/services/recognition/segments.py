"""Common base of recognisers that transcribe a stretch of speech after its end."""

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator

import numpy as np
from pipecat.frames.frames import (
    ErrorFrame,
    Frame,
    InputAudioRawFrame,
    InterimTranscriptionFrame,
    TranscriptionFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection
from pipecat.services.stt_service import SegmentedSTTService, STTService
from pipecat.utils.errors import ErrorCategory
from pipecat.utils.time import time_now_iso8601

from ico3d.chat.bucket import Bucket
from ico3d.chat.pipecat_internals import (
    forget_segment,
    is_user_speaking,
    keep_segment,
    segment,
    transcribe_segment,
)
from ico3d.chat.wire.protocol import MAX_QUESTION
from ico3d.errors import SettingsError

BLANK = " "
"""Final transcript of speech without words: ends a turn, adds nothing to the question."""
LONGEST_SPEECH = 30.0  # s of unbroken speech; a television never pauses
SHORTEST_CUT, LONGEST_CUT = 5.0, 300.0  # s that it may be set to
SEARCHED, MOMENT = (
    5.0,
    0.1,
)  # s before the cut in which a quiet moment is looked for, and its length
MOST_WAITING = 5  # stretches without a transcript; further ones are given up
STRETCH_RATE, STRETCHES_AT_ONCE = 2.0, 20  # that end per second for long, and at once
TOO_FAST = "the recogniser is slower than the visitor speaks."
SIGN_OF_LIFE = 0.5  # s; pipecat gives up a turn of which nothing is heard for much longer


def blank() -> TranscriptionFrame:
    """A frame that says that no words will follow for the visitor's speech."""
    return TranscriptionFrame(BLANK, "", time_now_iso8601(), finalized=True)


def check_longest_speech(seconds: float, where: str) -> None:
    """Checks the setting `longest_speech`.

    Raises:
        SettingsError: If the value is out of range.
    """
    if not SHORTEST_CUT <= seconds <= LONGEST_CUT:
        raise SettingsError(
            f"{where}: longest_speech must be {SHORTEST_CUT:g} to {LONGEST_CUT:g} seconds."
        )


def quiet_place(pcm: bytes | bytearray, rate: int) -> int:
    """Bytes of PCM16 before the quietest moment of the last seconds, where speech is cut."""
    samples = np.frombuffer(pcm, np.int16)
    moment, searched = int(MOMENT * rate), min(int(SEARCHED * rate), len(samples) // 2)
    count = searched // moment
    if count == 0:
        return len(pcm)
    begin = len(samples) - count * moment
    power = (samples[begin:].reshape(count, moment).astype(np.float32) ** 2).mean(axis=1)
    return 2 * (begin + int(power.argmin()) * moment + moment // 2)


class Segments(SegmentedSTTService):
    """Answers each stretch of speech with exactly one final transcript.

    Put this class before one of pipecat's segmented services among the bases. On their own, those
    services return nothing where they hear nothing, so that a turn of noise ends only by a
    time-out; the same time-out would end a turn while a slow transcript is on its way; of two
    stretches that are being transcribed, the first transcript would end the turn without the
    second; and speech without a pause would be buffered without limit, whereas here it is cut at a
    quiet place.
    """

    def __init__(self, longest: float, longest_speech: float = LONGEST_SPEECH, **options):
        """Sets the limits.

        Args:
            longest: Longest time in seconds for a transcript.
            longest_speech: Seconds of unbroken speech after which it is cut.
            options: Options of pipecat's service.
        """
        super().__init__(ttfs_p99_latency=longest, **options)
        self._longest_speech = longest_speech
        self._unanswered = 0  # stretches of speech
        self._has_told = False  # that some were given up, since all before had been answered
        self._pace = Bucket(STRETCH_RATE, STRETCHES_AT_ONCE, time.monotonic)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Counts the stretches of speech; a page may press and release its button without a pause.

        A stretch that is given up has no transcript. The turn ends with the last one that is on
        its way, or with a blank one.
        """
        if not isinstance(frame, VADUserStoppedSpeakingFrame):
            await super().process_frame(frame, direction)
        elif self._unanswered < MOST_WAITING and self._pace.take(1):
            self._unanswered += 1
            await super().process_frame(frame, direction)
        else:
            forget_segment(self)
            await STTService.process_frame(self, frame, direction)  # the class between keeps it
            await self._give_up()
            if self._unanswered == 0:
                await self.push_frame(blank())

    async def _give_up(self) -> None:
        """Says once that some speech is given up."""
        if not self._has_told:
            self._has_told = True
            await self.push_error(TOO_FAST)

    async def process_audio_frame(self, frame: InputAudioRawFrame, direction: FrameDirection):
        """Adds sound; unbroken speech that exceeds the limit is transcribed in pieces."""
        await super().process_audio_frame(frame, direction)
        most = int(self._longest_speech * self.sample_rate) * 2
        while is_user_speaking(self) and len(segment(self)) >= most:
            await self._hand_over(quiet_place(segment(self)[:most], self.sample_rate))

    async def _hand_over(self, length: int) -> None:
        """Has so many bytes of what is being said transcribed; the rest belongs to what follows."""
        rest = segment(self)[length:]
        if self._unanswered < MOST_WAITING:
            del segment(self)[length:]
            self._unanswered += 1
            await transcribe_segment(self)
        else:
            await self._give_up()
        keep_segment(self, rest)

    async def run_stt(self, audio: bytes) -> AsyncGenerator[Frame | None, None]:
        """Transcribes a stretch of speech; yields signs of life until it is done."""
        busy = self.create_task(self._say_busy(), "busy")
        frames: list[Frame | None] = []
        try:
            async for frame in super().run_stt(audio):  # type: ignore[reportAbstractUsage]
                frames.append(frame)
        except Exception as error:  # without it, for pipecat would give up the service for good
            sentence = f"the visitor's speech was not recognised: {error}"
            unknown = ErrorCategory.UNKNOWN  # none that would end the service, either
            frames.append(ErrorFrame(sentence, exception=error, category=unknown))
        finally:
            await self.cancel_task(busy)
            self._unanswered -= 1
            self._has_told = self._has_told and self._unanswered > 0
        if not any(isinstance(frame, TranscriptionFrame) for frame in frames):
            frames.append(blank())
        for frame in frames:
            yield frame

    async def push_frame(self, frame: Frame, direction: FrameDirection = FrameDirection.DOWNSTREAM):
        """Passes a frame on; a transcript is marked final only if no other is on its way.

        Of a transcript that is longer than a question may be, the beginning is kept.
        """
        if isinstance(frame, TranscriptionFrame):
            frame.text = frame.text.strip()[:MAX_QUESTION].strip() or BLANK
            frame.finalized = not is_user_speaking(self) and self._unanswered == 0
        await STTService.push_frame(self, frame, direction)  # the class between says final to all

    async def _say_busy(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(SIGN_OF_LIFE)
                await self.push_frame(InterimTranscriptionFrame("", "", time_now_iso8601()))
