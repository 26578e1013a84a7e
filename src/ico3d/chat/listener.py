"""The input of the pipeline, and the processor that shows the visitor what was understood."""

import time
from collections.abc import Callable

from pipecat.frames.frames import (
    Frame,
    InputAudioRawFrame,
    InterimTranscriptionFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMMessagesAppendFrame,
    LLMTextFrame,
    TranscriptionFrame,
    UserStartedSpeakingFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.frames import DeafFrame, HeardFrame, TalkFrame
from ico3d.chat.page import Page
from ico3d.chat.protocol import MICROPHONE_RATE, Transcript
from ico3d.chat.timing import TurnTimer


class PageInput(FrameProcessor):
    """Where the page's messages enter the pipeline."""

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes everything on."""
        await super().process_frame(frame, direction)
        await self.push_frame(frame, direction)

    async def hear(self, pcm: bytes) -> None:
        """Sound from the microphone, PCM16 mono 16 kHz."""
        await self.push_frame(InputAudioRawFrame(pcm, MICROPHONE_RATE, 1))

    async def talk(self, pressed: bool) -> None:
        """The button of push to talk."""
        await self.push_frame(TalkFrame(pressed))

    async def heard(self, result: int, text: str, final: bool) -> None:
        """What the browser's recogniser understood."""
        await self.push_frame(HeardFrame(result, text, final))

    async def deaf(self) -> None:
        """The browser cannot recognise speech."""
        await self.push_frame(DeafFrame())

    async def ask(self, text: str) -> None:
        """A typed question: whatever is being said stops, then it is answered."""
        await self.broadcast_interruption()
        message = {"role": "user", "content": text}
        await self.push_frame(LLMMessagesAppendFrame([message], run_llm=True))  # type: ignore[list-item]

    async def say(self, text: str) -> None:
        """Lets the avatar say something by itself, as if the language model had."""
        for frame in (LLMFullResponseStartFrame(), LLMTextFrame(text), LLMFullResponseEndFrame()):
            await self.push_frame(frame)


class Captions(FrameProcessor):
    """Sends transcripts and the listening state to the page; stands behind the recogniser.

    What is said over the avatar's voice is shown once it has become a turn.
    """

    def __init__(self, page: Page, timer: TurnTimer, now: Callable[[], float] = time.monotonic):
        """Captions for one session; `now` is the timer's clock."""
        super().__init__()
        self._page, self._timer, self._now = page, timer, now
        self._words = ""  # of the pieces of this turn that are final
        self._in_turn = False
        self._early: Transcript | None = None  # of a voice that may become a turn
        self._silent_since: float | None = None

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Looks at what passes; the aggregator's frames come from the other side."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterimTranscriptionFrame | TranscriptionFrame):
            self._transcribed(frame.text, isinstance(frame, TranscriptionFrame))
        elif isinstance(frame, VADUserStartedSpeakingFrame):
            self._silent_since = None
            if not self._in_turn:
                self._words, self._early = "", None
        elif isinstance(frame, VADUserStoppedSpeakingFrame) and self._is_down(direction):
            noticed = time.time() - frame.timestamp
            self._silent_since = self._now() - frame.stop_secs - noticed
            if self._in_turn:
                self._start_timer()
        elif isinstance(frame, UserStartedSpeakingFrame):
            self._begin()
        elif isinstance(frame, UserStoppedSpeakingFrame):
            self._in_turn = False
            self._timer.mark("turn")
            if self._page.state == "listening":  # else an apology has begun meanwhile
                self._page.show("thinking" if self._words else "idle")
            self._words = ""
        await self.push_frame(frame, direction)

    def _begin(self) -> None:
        self._in_turn = True
        self._page.show("listening")
        if self._early is not None:
            early, self._early = self._early, None
            self._show(early)
        if self._silent_since is not None:
            self._start_timer()

    def _start_timer(self) -> None:
        assert self._silent_since is not None
        self._timer.start(ago=self._now() - self._silent_since)
        self._timer.mark("vad")

    def _transcribed(self, text: str, final: bool) -> None:
        """Takes a transcript, which may hold no words: they tell only that it was listened."""
        if final:
            self._timer.mark("recognition")
        if text.strip():
            self._show(Transcript(self._joined(text), final))

    def _show(self, transcript: Transcript) -> None:
        if not self._in_turn:
            self._early = transcript
            return
        if transcript.final:
            self._words = transcript.text
        self._page.send(transcript)

    def _joined(self, text: str) -> str:
        return f"{self._words} {text}".strip()[:4000]

    @staticmethod
    def _is_down(direction: FrameDirection) -> bool:
        return direction == FrameDirection.DOWNSTREAM
