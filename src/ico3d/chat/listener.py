"""The input of the pipeline, and the processor that shows transcripts to the visitor."""

from pipecat.frames.frames import (
    Frame,
    InputAudioRawFrame,
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

from ico3d.chat.frames import MicrophoneFrame, PageFrame, TypedFrame, VoiceFrame
from ico3d.chat.page import Page
from ico3d.chat.services.recognition.room import Room
from ico3d.chat.wire.protocol import MICROPHONE_RATE, Audio, ClientMessage, Transcript


class PageInput(FrameProcessor):
    """The processor through which the page's messages enter the pipeline."""

    def __init__(self):
        """Starts without a pending question."""
        super().__init__()
        self._question: TypedFrame | None = None  # that is to be answered

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes every frame on."""
        await super().process_frame(frame, direction)
        await self.push_frame(frame, direction)

    async def hear(self, sound: Audio) -> None:
        """Pushes sound of the microphone into the pipeline."""
        pcm = sound.pcm.tobytes()
        frame = MicrophoneFrame(pcm, MICROPHONE_RATE, 1, sound.playing, sound.position)
        await self.push_frame(frame)

    async def pass_on(self, message: ClientMessage) -> None:
        """Pushes a message as `PageFrame`, for a processor further down the pipeline."""
        await self.push_frame(PageFrame(message))

    async def ask(self, text: str) -> None:
        """Stops speech and sends a typed question down the pipeline; `answer` must follow."""
        self._question = TypedFrame(text)
        await self.broadcast_interruption()
        await self.push_frame(self._question)

    async def interrupt(self) -> None:
        """Stops current and prepared speech."""
        self._question = None
        await self.broadcast_interruption()

    async def answer(self, question: TypedFrame) -> None:
        """Lets the language model answer a typed question, unless a newer one has replaced it.

        Called once all speech has stopped and the question is in the model's context.
        """
        if question is self._question:
            await self.push_frame(LLMRunFrame())

    async def say(self, text: str) -> None:
        """Makes the avatar say a text that does not come from the language model."""
        for frame in (LLMFullResponseStartFrame(), LLMTextFrame(text), LLMFullResponseEndFrame()):
            await self.push_frame(frame)


async def is_no_sound(frame: Frame) -> bool:
    """Whether a frame concerns processors behind the one that decides on turns.

    Handling sound of a microphone, 31 pieces a second, by each of them took half of all the time
    that a visitor costs who is silent.
    """
    return not isinstance(frame, InputAudioRawFrame | VoiceFrame)


class Captions(FrameProcessor):
    """Sends transcripts and the listening state to the page; stands behind the recogniser.

    It lets no more words of a turn pass than a typed question may have, whoever recognised them.
    Words spoken over the avatar's voice are shown only once they have become a turn.
    """

    def __init__(self, page: Page):
        """Creates the captions of one session."""
        super().__init__()
        self._page = page
        self._words = ""  # of the pieces of this turn that are final
        self._room, self._in_turn = Room(), False
        self._early: Transcript | None = None  # of a voice that may become a turn

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Watches frames in both directions; the aggregator's frames come from further down."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterimTranscriptionFrame | TranscriptionFrame):
            self._shorten(frame)
            self._transcribed(frame.text, isinstance(frame, TranscriptionFrame))
        elif isinstance(frame, VADUserStartedSpeakingFrame) and not self._in_turn:
            self._words, self._early = "", None
            self._room.clear()  # what was said before has become no turn
        elif isinstance(frame, UserStartedSpeakingFrame):
            self._begin()
        elif isinstance(frame, UserStoppedSpeakingFrame):
            self._in_turn = False
            if self._page.state == "listening":  # else an apology has begun meanwhile
                self._page.show("thinking" if self._words else "idle")
            self._words = ""
            self._room.clear()
        await self.push_frame(frame, direction)

    def _begin(self) -> None:
        self._in_turn = True
        self._page.show("listening")
        if self._early is not None:
            early, self._early = self._early, None
            self._show(early)

    def _shorten(self, frame: InterimTranscriptionFrame | TranscriptionFrame) -> None:
        """Leaves what has room in the turn; a blank, which may end it, in place of the rest."""
        if frame.text.strip():
            is_final = isinstance(frame, TranscriptionFrame)
            cut = self._room.take if is_final else self._room.fit
            frame.text = cut(frame.text) or " "

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
