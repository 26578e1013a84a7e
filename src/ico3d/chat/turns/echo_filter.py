"""The processor that prevents the avatar from hearing its own voice."""

import asyncio
from dataclasses import replace

import numpy as np
from pipecat.frames.frames import Frame
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.frames import MicrophoneFrame
from ico3d.chat.turns.echo import EchoGuard


class EchoFilter(FrameProcessor):
    """Replaces microphone sound that contains only echo by silence."""

    def __init__(self, guard: EchoGuard):
        """Creates the filter of one session; `guard` learns the echo of the room."""
        super().__init__()
        self._guard = guard

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes frames on; echo becomes silence of the same length."""
        await super().process_frame(frame, direction)
        if isinstance(frame, MicrophoneFrame):
            pcm = np.frombuffer(frame.audio, np.int16)
            if self._guard.is_echo(pcm, frame.playing, frame.position):
                frame = replace(frame, audio=bytes(len(frame.audio)))
            await asyncio.sleep(0)  # a second of sound took 9 ms, and a minute may come at once
        await self.push_frame(frame, direction)
