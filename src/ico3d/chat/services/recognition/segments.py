"""What recognisers have in common that get to work when a stretch of speech is over."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator

from pipecat.frames.frames import (
    ErrorFrame,
    Frame,
    InterimTranscriptionFrame,
    TranscriptionFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection
from pipecat.services.stt_service import SegmentedSTTService, STTService
from pipecat.utils.errors import ErrorCategory
from pipecat.utils.time import time_now_iso8601

BLANK = " "
"""Final transcript of speech without words: it ends a turn and adds nothing to the question."""
SIGN_OF_LIFE = 0.5  # s; pipecat gives up a turn of which nothing is heard for much longer


def blank() -> TranscriptionFrame:
    """Says that no words will come for what the visitor said."""
    return TranscriptionFrame(BLANK, "", time_now_iso8601(), finalized=True)


class Segments(SegmentedSTTService):
    """Answers each stretch of speech with one final transcript, and is waited for until then.

    Put it before one of pipecat's segmented services among the bases of a class. Left alone those
    would say nothing where they heard nothing, so that a turn of noise ends only by a time-out;
    that same time-out would end a turn while a slow transcript is under way; and of two stretches
    in the works the first transcript would end the turn without the second.
    """

    def __init__(self, longest: float, **options):
        """A service.

        Args:
            longest: Seconds that a transcript may take at most.
            options: Of pipecat's service.
        """
        super().__init__(ttfs_p99_latency=longest, **options)
        self._unanswered = 0  # stretches of speech

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Counts the stretches of speech."""
        if isinstance(frame, VADUserStoppedSpeakingFrame):
            self._unanswered += 1
        await super().process_frame(frame, direction)

    async def run_stt(self, audio: bytes) -> AsyncGenerator[Frame | None, None]:
        """Transcribes a stretch of speech; gives a signal from time to time until it is done."""
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
        if not any(isinstance(frame, TranscriptionFrame) for frame in frames):
            frames.append(blank())
        for frame in frames:
            yield frame

    async def push_frame(self, frame: Frame, direction: FrameDirection = FrameDirection.DOWNSTREAM):
        """Passes a frame on; a transcript is final only if nothing more is on its way."""
        if isinstance(frame, TranscriptionFrame):
            frame.text = frame.text.strip() or BLANK
            frame.finalized = not self._user_speaking and self._unanswered == 0
        await STTService.push_frame(self, frame, direction)  # the class between says final to all

    async def _say_busy(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(SIGN_OF_LIFE)
                await self.push_frame(InterimTranscriptionFrame("", "", time_now_iso8601()))
