"""Ends the visitor's turns, and prepares answers before the end is certain."""

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
    """Ends turns by Smart-Turn; prepares an answer while the decision is open.

    After a pause that sounds unfinished, the turn ends only if the silence continues. The language
    model gets the words at once, on a copy of the context. pipecat's gate holds the answer back
    until the turn ends with these very words; if the visitor continues, the answer is discarded.
    """

    def __init__(self, speculate: bool, analyzer: EagerSmartTurn, **kwargs):
        """Creates the strategy of one session; further arguments are those of the base class."""
        super().__init__(turn_analyzer=analyzer, **kwargs)
        self._speculate, self._analyzer = speculate, analyzer
        self._match = NormalizedMatch()
        self._said = ""  # in this turn
        self._prepared: str | None = None  # the words that are being answered
        self._open = False  # a turn is
        self._silent = True

    async def handle_user_turn_started(self):
        """Registers that a turn has begun."""
        await super().handle_user_turn_started()
        self._said, self._open = "", True

    async def handle_user_turn_stopped(self):
        """Registers that the turn has ended, by this strategy or another."""
        self._open = False
        await self._withdraw()
        await super().handle_user_turn_stopped()

    async def process_frame(self, frame: Frame) -> ProcessFrameResult:
        """Follows the voice and the words."""
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
        """Ends the turn; releases the answer if it was prepared for these very words."""
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
    """Push to talk: no turn ends while the button is held; releasing the button ends it at once.

    This strategy must precede others and hides from them what happens while the button is held.
    """

    def __init__(self):
        """Starts with the button released."""
        super().__init__()
        self._patience = 0.0  # s that the recogniser may need for the last words
        self._held = self._released = False
        self._words = False
        self._timer: asyncio.Task | None = None

    async def cleanup(self):
        """Cancels the timer."""
        await super().cleanup()
        await self._stop_timer()

    async def handle_user_turn_stopped(self):
        """Registers that the turn has ended, by this strategy or another."""
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
