"""The processor that keeps the avatar from hearing itself."""

from collections.abc import Callable

import numpy as np
from pipecat.frames.frames import Frame, InputAudioRawFrame
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from ico3d.chat.turns.echo import EchoGuard


class EchoFilter(FrameProcessor):
    """Puts silence in the place of microphone sound that is nothing but the avatar's own."""

    def __init__(self, guard: EchoGuard, position: Callable[[], float | None]):
        """A filter; `position` tells what is heard now, in seconds of the utterance."""
        super().__init__()
        self._guard, self._position = guard, position

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes everything on, echo as silence of the same length."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InputAudioRawFrame):
            pcm = np.frombuffer(frame.audio, np.int16)
            if self._guard.is_echo(pcm, self._position()):
                silence = bytes(len(frame.audio))
                frame = InputAudioRawFrame(silence, frame.sample_rate, frame.num_channels)
        await self.push_frame(frame, direction)
