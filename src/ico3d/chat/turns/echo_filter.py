"""The processor that keeps the avatar from hearing itself."""

import time
from collections.abc import Callable

import numpy as np
from pipecat.frames.frames import Frame, InputAudioRawFrame
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.turns.echo import EchoGuard

STALLED = 0.5  # s by which sound may come later than before; more is a microphone that was off
DRIFT = 0.001  # by which clocks may differ


class Arrival:
    """How long sound has been on its way, beyond what the fastest takes."""

    def __init__(self, now: Callable[[], float]):
        """Reads the clock `now`, in seconds."""
        self._now = now
        self._sound = 0.0  # s that have come
        self._least: float | None = None  # of clock less sound

    def delay(self, seconds: float) -> float:
        """Seconds by which the next `seconds` of sound are late."""
        self._sound += seconds
        behind = self._now() - self._sound
        if self._least is None or behind > self._least + STALLED:
            self._least = behind
        self._least = min(behind, self._least + DRIFT * seconds)
        return behind - self._least


class EchoFilter(FrameProcessor):
    """Puts silence in the place of microphone sound that is nothing but the avatar's own."""

    def __init__(
        self,
        guard: EchoGuard,
        position: Callable[[], float | None],
        now: Callable[[], float] = time.monotonic,
    ):
        """A filter for one session.

        Args:
            guard: Knows the avatar's sound, and learns the room.
            position: What is heard at the page now, in seconds of the utterance.
            now: The clock, seconds.
        """
        super().__init__()
        self._guard, self._position = guard, position
        self._arrival = Arrival(now)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes everything on, echo as silence of the same length."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InputAudioRawFrame) and self._is_echo(frame):
            silence = bytes(len(frame.audio))
            frame = InputAudioRawFrame(silence, frame.sample_rate, frame.num_channels)
        await self.push_frame(frame, direction)

    def _is_echo(self, frame: InputAudioRawFrame) -> bool:
        pcm = np.frombuffer(frame.audio, np.int16)
        late = self._arrival.delay(len(pcm) / frame.sample_rate)
        position = self._position()
        return self._guard.is_echo(pcm, None if position is None else position - late)
