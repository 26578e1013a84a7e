"""The input of the pipeline, and the processor that shows the visitor what was understood."""

from pipecat.frames.frames import (
    Frame,
    InterimTranscriptionFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMRunFrame,
    LLMTextFrame,
    TranscriptionFrame,
    UserStartedSpeakingFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.frames import MicrophoneFrame, PageFrame, TypedFrame
from ico3d.chat.page import Page
from ico3d.chat.wire.protocol import MICROPHONE_RATE, Audio, ClientMessage, Transcript


class PageInput(FrameProcessor):
    """Where the page's messages enter the pipeline."""

    def __init__(self):
        """Nothing was asked."""
        super().__init__()
        self._question: TypedFrame | None = None  # that is to be answered

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes everything on."""
        await super().process_frame(frame, direction)
        await self.push_frame(frame, direction)

    async def hear(self, sound: Audio) -> None:
        """Sound from the microphone."""
        pcm = sound.pcm.tobytes()
        frame = MicrophoneFrame(pcm, MICROPHONE_RATE, 1, sound.playing, sound.position)
        await self.push_frame(frame)

    async def pass_on(self, message: ClientMessage) -> None:
        """A message that a processor behind this one acts on, as `PageFrame`."""
        await self.push_frame(PageFrame(message))

    async def ask(self, text: str) -> None:
        """A typed question: whatever is being said stops; `answer` comes when all have stopped."""
        self._question = TypedFrame(text)
        await self.broadcast_interruption()
        await self.push_frame(self._question)

    async def interrupt(self) -> None:
        """Whatever is being said or prepared stops."""
        self._question = None
        await self.broadcast_interruption()

    async def answer(self, question: TypedFrame) -> None:
        """Asks the language model, which knows the question, unless it was taken back since."""
        if question is self._question:
            await self.push_frame(LLMRunFrame())

    async def say(self, text: str) -> None:
        """Lets the avatar say something by itself, as if the language model had."""
        for frame in (LLMFullResponseStartFrame(), LLMTextFrame(text), LLMFullResponseEndFrame()):
            await self.push_frame(frame)


class Captions(FrameProcessor):
    """Sends transcripts and the listening state to the page; stands behind the recogniser.

    What is said over the avatar's voice is shown once it has become a turn.
    """

    def __init__(self, page: Page):
        """Captions for one session."""
        super().__init__()
        self._page = page
        self._words = ""  # of the pieces of this turn that are final
        self._in_turn = False
        self._early: Transcript | None = None  # of a voice that may become a turn

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Looks at what passes; the aggregator's frames come from the other side."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterimTranscriptionFrame | TranscriptionFrame):
            self._transcribed(frame.text, isinstance(frame, TranscriptionFrame))
        elif isinstance(frame, VADUserStartedSpeakingFrame) and not self._in_turn:
            self._words, self._early = "", None
        elif isinstance(frame, UserStartedSpeakingFrame):
            self._begin()
        elif isinstance(frame, UserStoppedSpeakingFrame):
            self._in_turn = False
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

    def _transcribed(self, text: str, final: bool) -> None:
        """Takes a transcript, which may hold no words: they tell only that it was listened."""
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
