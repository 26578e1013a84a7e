"""The output of the pipeline: sends speech ahead of playback and knows when it has ended.

pipecat's own output transports cut sound into new pieces and sleep between them, by which data that
belong to a piece would be lost. Here sound and face travel in one message, at most 2 s ahead; the
page schedules them, and its `clock` messages tell when the avatar has really fallen silent.
"""

import asyncio
import contextlib
import json
import time
from collections.abc import Callable, Mapping
from typing import Any

from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    Frame,
    FunctionCallCancelFrame,
    FunctionCallResultFrame,
    FunctionCallsStartedFrame,
    InterruptionFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.frames import SpeechFrame, UtteranceEndFrame, Utterances
from ico3d.chat.page import Page
from ico3d.chat.performing.cueing import Cueing
from ico3d.chat.performing.gestures import Gestures
from ico3d.chat.playback import Playback
from ico3d.chat.turns.echo import SentSound
from ico3d.chat.wire.characters import sendable
from ico3d.chat.wire.marks import LONGEST_NAME
from ico3d.chat.wire.protocol import (
    MAX_ARGUMENTS,
    Answer,
    Call,
    Clock,
    End,
    Pause,
    Resume,
    Stop,
)

SOONEST = 0.005  # s between two looks at the clock


class Speaker(FrameProcessor):
    """Sends `SpeechFrame`s to the page, paced by the page's playback."""

    def __init__(
        self,
        page: Page,
        utterances: Utterances,
        sent: SentSound,
        gestures: Gestures | Cueing | None = None,
        now: Callable[[], float] = time.monotonic,
    ):
        """Creates the speaker of one session.

        Args:
            page: Receives the speech.
            utterances: Knows which answers were stopped.
            sent: Receives sound that the page may play and that may come back as echo.
            gestures: Moves the avatar's body, if it has one.
            now: Returns the time in seconds.
        """
        super().__init__()
        self._page, self._utterances, self._sent, self._now = page, utterances, sent, now
        self._gestures = gestures
        self._playback = Playback()
        self._moved = asyncio.Event()  # the page's clock or connection changed
        self._speaking: int | None = None
        self._paused = False
        self._calls: set[str] = set()  # functions that the language model waits for

    def clock(self, message: Clock) -> None:
        """Takes a report of the page's playback."""
        self._playback.clock(message.utterance, message.position, self._now())
        self._moved.set()
        if message.utterance == self._speaking and self._gestures is not None:
            self._gestures.clock(message, self._playback.position(self._now()))

    def hold(self) -> None:
        """Stops sending, because the connection was lost."""
        self._playback.hold(self._now())

    def release(self) -> None:
        """Resumes sending, because the page has reconnected."""
        self._go_on()

    def hush(self, silent: bool) -> None:
        """Pauses playback, or resumes it without loss."""
        if self._speaking is None or silent == self._paused:
            return
        self._paused = silent
        self._page.send(Pause(self._speaking) if silent else Resume(self._speaking))
        if silent:
            self._playback.hold(self._now())
        else:
            self._go_on()

    def _go_on(self) -> None:
        if self._page.is_attached and not self._paused:
            self._playback.release(self._now())
        self._moved.set()

    def is_speaking(self, utterance: int | None) -> bool:
        """Whether an utterance (for None, any) is being played or about to be."""
        if self._speaking is None:
            return False
        return utterance is None or utterance == self._speaking

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Sends speech, ends and stops utterances, and passes other frames on."""
        await super().process_frame(frame, direction)
        if isinstance(frame, SpeechFrame):
            await self._send(frame)
            return
        if isinstance(frame, UtteranceEndFrame):
            await self._end(frame)
            return
        if isinstance(frame, InterruptionFrame):
            await self._stop()
        elif isinstance(frame, LLMFullResponseStartFrame):
            self._page.show("thinking")
        elif isinstance(frame, LLMFullResponseEndFrame):
            self._page.show("thinking" if self._calls else "idle")
        elif isinstance(frame, FunctionCallsStartedFrame):
            self._calls.update(call.tool_call_id for call in frame.function_calls)
            for call in frame.function_calls:
                self._page.send(tool_call(call.function_name, call.arguments))
        elif isinstance(frame, FunctionCallResultFrame | FunctionCallCancelFrame):
            self._called(frame)
        await self.push_frame(frame, direction)

    def _called(self, frame: FunctionCallResultFrame | FunctionCallCancelFrame) -> None:
        """A function has ended; the language model goes on unless it has said all already."""
        self._calls.discard(frame.tool_call_id)
        properties = getattr(frame, "properties", None)
        is_over = isinstance(frame, FunctionCallCancelFrame) or (
            properties is not None and properties.run_llm is False and not self._calls
        )
        if is_over and self._page.state == "thinking":
            self._page.show("idle")

    async def _send(self, frame: SpeechFrame) -> None:
        if self._utterances.is_stopped(frame.utterance):
            return  # it was on its way when the interruption overtook it
        end = frame.first_sample + len(frame.pcm)
        first = frame.utterance != self._speaking
        if first:
            self._begin(frame.utterance)
        await self._wait(lambda: self._playback.wait_to_send(end, self._now()))
        if frame.text is not None:
            self._page.send(Answer(frame.utterance, frame.first_sample, frame.text))
        self._page.send_speech(frame)
        self._sent.add(frame.utterance, frame.pcm)
        self._playback.sent(end, self._now())
        if first:
            await self.broadcast_frame(BotStartedSpeakingFrame)

    def _begin(self, utterance: int) -> None:
        self._speaking, self._paused = utterance, False
        self._playback.begin(utterance)
        self._page.show("speaking")

    async def _end(self, frame: UtteranceEndFrame) -> None:
        if self._utterances.is_stopped(frame.utterance):
            return
        self._page.send(End(frame.utterance, frame.samples))
        await self._wait(lambda: self._playback.remaining(self._now()))
        self._speaking = None
        self._page.show("thinking" if self._calls else "idle")
        await self.broadcast_frame(BotStoppedSpeakingFrame)

    async def _stop(self) -> None:
        self._utterances.stop_all()
        self._calls.clear()
        utterance, self._speaking = self._speaking, None
        if self._page.state != "listening":
            self._page.show("idle")
        if self._gestures is not None:
            self._gestures.stop()
        if utterance is not None:
            self._paused = False
            self._go_on()
            self._page.send(Stop(utterance))
            await self.broadcast_frame(BotStoppedSpeakingFrame)

    async def _wait(self, seconds: Callable[[], float]) -> None:
        """Waits until `seconds()` is no longer positive; the page's clock may change it."""
        left = seconds()
        while left > 0:
            self._moved.clear()
            held = not self._page.is_attached
            try:
                timeout = None if held else max(left, SOONEST)
                await asyncio.wait_for(self._moved.wait(), timeout)
            except TimeoutError:
                pass
            left = seconds()


def tool_call(name: str, arguments: Any) -> Call:
    """What the page is told of a function that the language model calls.

    Models write what they like: arguments that are no object of JSON, or too long, are left out.
    """
    text = "{}"
    if isinstance(arguments, Mapping):
        with contextlib.suppress(ValueError):  # JSON has no infinity
            text = sendable(json.dumps(arguments, ensure_ascii=False, default=str, allow_nan=False))
    return Call(sendable(name)[:LONGEST_NAME], text if len(text) <= MAX_ARGUMENTS else "{}")
