"""The processor that keeps the avatar from hearing itself."""

from dataclasses import replace

import numpy as np
from pipecat.frames.frames import Frame
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.frames import MicrophoneFrame
from ico3d.chat.turns.echo import EchoGuard


class EchoFilter(FrameProcessor):
    """Puts silence in the place of microphone sound that is nothing but the avatar's own."""

    def __init__(self, guard: EchoGuard):
        """A filter for one session, whose guard knows the avatar's sound and learns the room."""
        super().__init__()
        self._guard = guard

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes everything on, echo as silence of the same length."""
        await super().process_frame(frame, direction)
        if isinstance(frame, MicrophoneFrame):
            pcm = np.frombuffer(frame.audio, np.int16)
            if self._guard.is_echo(pcm, frame.playing, frame.position):
                frame = replace(frame, audio=bytes(len(frame.audio)))
        await self.push_frame(frame, direction)
