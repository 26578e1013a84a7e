"""Turns a missing answer of the language model into an apology."""

import asyncio

from loguru import logger
from pipecat.frames.frames import (
    ErrorFrame,
    Frame,
    FunctionCallsStartedFrame,
    InterruptionFrame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    LLMThoughtTextFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.settings.conversation import Patience
from ico3d.chat.supervision.apologies import Failed, apology


class AnswerGuard(FrameProcessor):
    """Watches answers between language model and voice.

    The visitor hears an apology instead of silence if the model returns no words, breaks off, or
    exceeds the limits of `patience`, and if the recogniser has failed. Thoughts of a model count as
    a sign of life and are not passed on. An answer that is too long is cut off. All other frames
    pass unchanged.
    """

    def __init__(
        self,
        recognition: FrameProcessor,
        language: FrameProcessor,
        patience: Patience,
        tongue: str,
        longest: int,
    ):
        """Creates the guard of one session.

        Args:
            recognition: Recogniser for whose errors to apologise.
            language: Language model whose answers are watched.
            patience: Time limits of an answer, of a piece of it, and of thinking.
            tongue: Language code of the apologies.
            longest: Letters of an answer after which it is cut off.
        """
        super().__init__()
        self._patience, self._tongue, self._longest = patience, tongue, longest
        self._letters, self._over = 0, False  # of this answer, and whether it was cut off
        self._answering = False  # between the start of an answer and its end
        self._spoken = self._called = self._broken = False  # this answer has words, calls, an error
        self._timer: asyncio.TimerHandle | None = None
        self._latest = 0.0  # until when it may think, the event loop's clock
        language.add_event_handler("on_before_process_frame", self._asked)
        language.add_event_handler("on_error", self._language_failed)
        recognition.add_event_handler("on_error", self._recognition_failed)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Follows an answer; adds an apology at the end of an empty or broken one."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterruptionFrame):
            self._stop_timer()
            self._answering = False
        elif direction == FrameDirection.DOWNSTREAM:
            if isinstance(frame, LLMFullResponseStartFrame):
                self._begin()
            elif isinstance(frame, LLMThoughtTextFrame):
                self._think()
                return
            elif isinstance(frame, LLMTextFrame) and self._over:
                return  # it was on its way when the answer was cut off
            elif isinstance(frame, LLMTextFrame) and frame.text.strip():
                self._spoken = True
                self._start_timer()
                self._letters += len(frame.text)
                if self._letters > self._longest:
                    await self._cut(frame)
                    return
            elif isinstance(frame, FunctionCallsStartedFrame):
                self._called = True
                self._stop_timer()
            elif isinstance(frame, LLMFullResponseEndFrame):
                await self._end(frame)
                return
        await self.push_frame(frame, direction)

    async def cleanup(self):
        """Cancels the timer."""
        await super().cleanup()
        self._stop_timer()

    def _begin(self) -> None:
        self._answering = True
        self._spoken = self._called = self._broken = False
        self._letters, self._over = 0, False
        self._start_timer()

    async def _end(self, frame: LLMFullResponseEndFrame) -> None:
        self._stop_timer()
        if not self._answering:
            return  # it was given up before, and has its end
        self._answering = False
        if self._broken or not (self._spoken or self._called):
            await self._apologise("language")
        await self.push_frame(frame)

    async def _asked(self, _: FrameProcessor, frame: Frame) -> None:
        """The model takes a question; one that may yet change is not waited for."""
        if isinstance(frame, LLMContextFrame) and not frame.speculation:
            self._start_timer()

    async def _language_failed(self, _: FrameProcessor, error: ErrorFrame) -> None:
        # a summary is made beside the answer, which does without it
        self._broken = self._broken or "summar" not in error.error

    async def _recognition_failed(self, _: FrameProcessor, error: ErrorFrame) -> None:
        if not self._answering:
            await self._say("recognition")

    async def _give_up(self) -> None:
        """Stops the model where it stands, and ends its answer."""
        self._timer = None
        logger.error(
            f"language gave nothing for {self._patience.language:g} s, or thought for more than "
            f"{self._patience.reasoning:g} s"
        )
        await self.push_frame(InterruptionFrame(), FrameDirection.UPSTREAM)
        if not self._answering:
            await self._say("language")
            return
        self._answering = False
        await self._apologise("language")
        await self.push_frame(LLMFullResponseEndFrame())

    async def _cut(self, frame: LLMTextFrame) -> None:
        """Ends an answer amid the piece that makes it too long."""
        left = len(frame.text) - (self._letters - self._longest)
        logger.warning(f"language gave more than {self._longest} letters; the answer was cut off")
        self._stop_timer()
        self._answering, self._over = False, True
        await self.push_frame(InterruptionFrame(), FrameDirection.UPSTREAM)
        await self.push_frame(LLMTextFrame(frame.text[:left] + "…"))
        await self.push_frame(LLMFullResponseEndFrame())

    async def _say(self, failed: Failed) -> None:
        """An apology as an answer of its own."""
        self._spoken = False
        await self.push_frame(LLMFullResponseStartFrame())
        await self._apologise(failed)
        await self.push_frame(LLMFullResponseEndFrame())

    async def _apologise(self, failed: Failed) -> None:
        gap = " " if self._spoken else ""
        await self.push_frame(LLMTextFrame(gap + apology(failed, self._tongue)))

    def _think(self) -> None:
        """A sign of life, if an answer is waited for: there is time until the next, up to a cap."""
        if self._timer is not None:
            left = self._latest - asyncio.get_running_loop().time()
            self._wait(min(self._patience.language, max(left, 0.0)))

    def _start_timer(self) -> None:
        self._latest = asyncio.get_running_loop().time() + self._patience.reasoning
        self._wait(self._patience.language)

    def _wait(self, seconds: float) -> None:
        self._stop_timer()
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(seconds, lambda: self.create_task(self._give_up(), "give up"))

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
