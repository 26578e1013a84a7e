"""Starts the visitor's turns: at once in silence; during the avatar's speech `Floor` decides."""

import asyncio
from collections.abc import Callable

from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    Frame,
    InterimTranscriptionFrame,
    TranscriptionFrame,
    UserBackchannelFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.turns.types import ProcessFrameResult
from pipecat.turns.user_start import BaseUserTurnStartStrategy

from ico3d.chat.frames import VoiceFrame, message_in
from ico3d.chat.turns.floor import Floor, Verdict
from ico3d.chat.wire.protocol import Talk

LOOK = 0.05  # s between two looks at the clock while the avatar waits


class FloorTurnStart(BaseUserTurnStartStrategy):
    """Starts turns, and pauses and resumes the avatar while a voice is being judged."""

    def __init__(self, floor: Floor, hush: Callable[[bool], None]):
        """Creates the strategy of one session; `hush(True)` pauses, `hush(False)` resumes."""
        super().__init__()
        self._floor, self._hush = floor, hush
        self._in_turn = False
        self._voice = False  # the VAD is sure of one
        self._watch: asyncio.Task | None = None

    async def cleanup(self):
        """Cancels the timer."""
        await super().cleanup()
        if self._watch is not None:
            await self.task_manager.cancel_task(self._watch)
            self._watch = None

    async def handle_user_turn_started(self):
        """Registers that a turn has begun, by this strategy or another."""
        self._in_turn = True

    async def handle_user_turn_stopped(self):
        """Registers that the turn has ended."""
        self._in_turn = False

    async def process_frame(self, frame: Frame) -> ProcessFrameResult:
        """Follows voices, words and the avatar's speech."""
        await super().process_frame(frame)
        if isinstance(frame, BotStartedSpeakingFrame):
            self._floor.avatar(True)
        elif isinstance(frame, BotStoppedSpeakingFrame):
            await self._fall_silent()
        elif isinstance(frame, VoiceFrame):
            await self._follow(self._floor.hear(frame))
        elif talk := message_in(frame, Talk):
            if talk.pressed:
                await self.trigger_user_turn_started()
        elif isinstance(frame, VADUserStartedSpeakingFrame):
            self._voice = True
            if not self._floor.is_speaking:
                await self.trigger_user_turn_started()
        elif isinstance(frame, VADUserStoppedSpeakingFrame):
            self._voice = False
        elif isinstance(frame, InterimTranscriptionFrame | TranscriptionFrame):
            await self._understand(frame)
        return ProcessFrameResult.CONTINUE

    async def _fall_silent(self) -> None:
        """The avatar has said all: whoever speaks now has the floor."""
        undecided = self._floor.is_paused
        self._floor.avatar(False)
        if undecided and self._voice:
            await self.trigger_user_turn_started()

    async def _understand(self, frame: InterimTranscriptionFrame | TranscriptionFrame) -> None:
        if self._in_turn:
            return
        final = isinstance(frame, TranscriptionFrame)
        late = final and bool(frame.text.strip())  # a blank one says that there are no words
        if late and not self._floor.is_disputed and not self._floor.is_speaking:
            await self.trigger_user_turn_started()  # a recogniser slower than the watchdog
            return
        verdict = self._floor.understand(frame.text, final)
        if final and verdict is not Verdict.YIELD:
            await self.trigger_reset_aggregation()  # it is no part of any turn
            await self.push_frame(UserBackchannelFrame(frame.text, frame.user_id, frame.timestamp))
        await self._follow(verdict)

    async def _follow(self, verdict: Verdict | None) -> None:
        if verdict is Verdict.PAUSE:
            self._hush(True)
            if self._watch is None:
                self._watch = self.task_manager.create_task(self._wait(), f"{self}::wait")
        elif verdict is Verdict.RESUME:
            self._hush(False)
        elif verdict is Verdict.YIELD:
            await self.trigger_user_turn_started()

    async def _wait(self) -> None:
        """Looks at the clock: a microphone that is turned off sends no more silence."""
        while self._floor.is_paused:
            await asyncio.sleep(LOOK)
            await self._follow(self._floor.wait())
        self._watch = None
