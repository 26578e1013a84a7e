"""Says one short sentence while a tool keeps the visitor waiting."""

import asyncio

from pipecat.frames.frames import (
    Frame,
    FunctionCallCancelFrame,
    FunctionCallResultFrame,
    FunctionCallsStartedFrame,
    InterruptionFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TTSSpeakFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.settings.tools import OWN
from ico3d.chat.supervision.apologies import waiting


class Filler(FrameProcessor):
    """Watches calls of functions between language model and voice.

    The sentence comes once in an answer, and only where nothing has been said in it: not over the
    model's own "let me look", and not into what the visitor says. The language model does not see
    it. Gestures and moods keep nobody waiting.
    """

    def __init__(self, seconds: float, tongue: str):
        """Creates the filler of one session.

        Args:
            seconds: How long a tool may take before the sentence is said; 0 for never saying it.
            tongue: Language code of the sentence.
        """
        super().__init__()
        self._seconds, self._tongue = seconds, tongue
        self._calls: set[str] = set()  # that have not ended
        self._said = False  # whether this answer has words, or had its sentence
        self._called = False  # whether the model is asked again once the calls have ended
        self._timer: asyncio.TimerHandle | None = None

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Follows an answer, and passes every frame on."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterruptionFrame):
            self._calls.clear()
            self._stop(said=False)
        elif direction == FrameDirection.DOWNSTREAM:
            self._follow(frame)
        await self.push_frame(frame, direction)

    async def cleanup(self):
        """Cancels the timer."""
        await super().cleanup()
        self._stop(said=True)

    def _follow(self, frame: Frame) -> None:
        if isinstance(frame, LLMFullResponseStartFrame):
            self._called = False
        elif isinstance(frame, LLMTextFrame) and frame.text.strip():
            self._stop(said=True)
        elif isinstance(frame, FunctionCallsStartedFrame):
            calls = [c.tool_call_id for c in frame.function_calls if c.function_name not in OWN]
            self._calls.update(calls)
            self._called = self._called or bool(calls)
            self._wait()
        elif isinstance(frame, FunctionCallResultFrame | FunctionCallCancelFrame):
            self._calls.discard(frame.tool_call_id)
            if not self._calls:
                self._stop(self._said)
        elif isinstance(frame, LLMFullResponseEndFrame) and not self._called:
            self._stop(said=False)  # the answer is over

    def _wait(self) -> None:
        if self._calls and self._seconds and not self._said and self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(
                self._seconds, lambda: self.create_task(self._say(), "filler")
            )

    async def _say(self) -> None:
        if self._timer is None:
            return  # the answer, or the visitor, was as quick as the timer
        self._stop(said=True)
        await self.push_frame(TTSSpeakFrame(waiting(self._tongue), append_to_context=False))

    def _stop(self, said: bool) -> None:
        self._said = said
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
