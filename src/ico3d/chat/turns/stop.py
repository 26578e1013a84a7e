"""When a turn of the visitor ends, and the answer that is prepared before that is certain."""

import asyncio

from pipecat.frames.frames import (
    Frame,
    STTMetadataFrame,
    TranscriptionFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.turns.types import ProcessFrameResult, UserTurnSpeculation
from pipecat.turns.user_stop import (
    BaseUserTurnStopStrategy,
    NormalizedMatch,
    TurnAnalyzerUserTurnStopStrategy,
)

from ico3d.chat.frames import VoiceFrame, message_in
from ico3d.chat.turns.eager import EagerSmartTurn
from ico3d.chat.wire.protocol import Talk


class SpeculativeTurnStop(TurnAnalyzerUserTurnStopStrategy):
    """Smart-Turn's decision; while it waits for more, an answer is prepared.

    A pause that sounds unfinished ends the turn only after a longer silence. The language model
    gets the words at once, on a copy of the context, and pipecat's gate holds its answer: until
    the turn ends with these words, or for ever, when the visitor goes on.
    """

    def __init__(self, speculate: bool, analyzer: EagerSmartTurn, **kwargs):
        """A strategy for one session; the rest as the base takes it."""
        super().__init__(turn_analyzer=analyzer, **kwargs)
        self._speculate, self._analyzer = speculate, analyzer
        self._match = NormalizedMatch()
        self._said = ""  # in this turn
        self._prepared: str | None = None  # the words that are being answered
        self._open = False  # a turn is
        self._silent = True

    async def handle_user_turn_started(self):
        """A turn has begun."""
        await super().handle_user_turn_started()
        self._said, self._open = "", True

    async def handle_user_turn_stopped(self):
        """The turn has ended, by this or another way."""
        self._open = False
        await self._withdraw()
        await super().handle_user_turn_stopped()

    async def process_frame(self, frame: Frame) -> ProcessFrameResult:
        """Follows voice and words."""
        if isinstance(frame, VoiceFrame):
            self._analyzer.listen(frame.silence)
        elif isinstance(frame, VADUserStartedSpeakingFrame):
            self._silent = False
            await self._withdraw()
        elif isinstance(frame, VADUserStoppedSpeakingFrame):
            self._silent = True
        elif isinstance(frame, TranscriptionFrame) and self._open:
            self._said = f"{self._said} {frame.text}".strip()
        result = await super().process_frame(frame)
        if isinstance(frame, TranscriptionFrame) and frame.finalized:
            await self._prepare()
        return result

    async def trigger_user_turn_stopped(self, *, enable_user_speaking_frames: bool | None = None):
        """Ends the turn; what was prepared for these very words is released."""
        prepared, self._prepared = self._prepared, None
        if prepared is not None and self._match.matches(prepared, self._said):
            await self.trigger_user_turn_finalized(
                enable_user_speaking_frames=enable_user_speaking_frames, confirms_speculation=True
            )
            return
        self._prepared = prepared
        await self._withdraw()
        await super().trigger_user_turn_stopped(
            enable_user_speaking_frames=enable_user_speaking_frames
        )

    async def _prepare(self) -> None:
        if not (self._speculate and self._open and self._silent and self._said):
            return
        if self._prepared is not None:
            await self._withdraw()
        self._prepared = self._said
        speculation = UserTurnSpeculation(self._said)
        await self.trigger_user_turn_inference_triggered(speculation=speculation)

    async def _withdraw(self) -> None:
        if self._prepared is not None:
            self._prepared = None
            await self.trigger_user_turn_speculation_cancelled()


class ReleaseTurnStop(BaseUserTurnStopStrategy):
    """Push to talk: while the button is held nothing ends the turn, letting go does at once.

    It comes before other strategies and keeps from them what happens meanwhile.
    """

    def __init__(self):
        """Nobody holds the button."""
        super().__init__()
        self._patience = 0.0  # s that the recogniser may need for the last words
        self._held = self._released = False
        self._words = False
        self._timer: asyncio.Task | None = None

    async def cleanup(self):
        """Ends the timer."""
        await super().cleanup()
        await self._stop_timer()

    async def handle_user_turn_stopped(self):
        """The turn has ended, by this or another way."""
        self._released = self._words = False
        await self._stop_timer()

    async def process_frame(self, frame: Frame) -> ProcessFrameResult:
        """Follows the button and the words."""
        await super().process_frame(frame)
        if isinstance(frame, STTMetadataFrame):
            self._patience = frame.ttfs_p99_latency
        elif talk := message_in(frame, Talk):
            await self._talk(talk.pressed)
        elif isinstance(frame, TranscriptionFrame) and (self._held or self._released):
            self._words = True
            if self._released:
                await self.trigger_user_turn_stopped()
                return ProcessFrameResult.STOP
        hidden = self._held or self._released
        return ProcessFrameResult.STOP if hidden else ProcessFrameResult.CONTINUE

    async def _talk(self, pressed: bool) -> None:
        await self._stop_timer()
        self._released = self._held and not pressed
        self._held = pressed
        if pressed:
            self._words = False
        elif self._released:
            self._timer = self.task_manager.create_task(self._wait(), f"{self}::wait")

    async def _wait(self) -> None:
        """A recogniser that has told all words already sends nothing at the end."""
        await asyncio.sleep(self._patience)
        self._timer = None
        if self._words:
            await self.trigger_user_turn_stopped()

    async def _stop_timer(self) -> None:
        if self._timer is not None:
            timer, self._timer = self._timer, None
            await self.task_manager.cancel_task(timer)
