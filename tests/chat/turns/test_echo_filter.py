"""The processor that silences the avatar's own voice lets others have their turns."""

import asyncio

import numpy as np
import pytest

from ico3d.chat.frames import MicrophoneFrame
from ico3d.chat.remote.headless import run
from ico3d.chat.turns.echo_filter import EchoFilter

pytestmark = pytest.mark.slow


class Guard:
    """Calls every other piece an echo."""

    def __init__(self):
        self.pieces = 0

    def is_echo(self, *_):
        self.pieces += 1
        return self.pieces % 2 == 1


async def test_sound_that_comes_at_once_holds_nobody_up():
    """A minute of it held up everybody for half a second, of eight visitors for three."""
    loud = np.full(320, 1000, np.int16).tobytes()
    frames = [MicrophoneFrame(loud, 16000, 1, playing=0) for _ in range(100)]
    turns, guard = 0, Guard()

    async def take_turns():
        nonlocal turns
        while guard.pieces < len(frames):
            turns += guard.pieces > 0
            await asyncio.sleep(0)

    others = asyncio.create_task(take_turns())
    heard = [one async for one in run(EchoFilter(guard), frames, 30)]
    await others
    sounds = [one.audio for one in heard if isinstance(one, MicrophoneFrame)]
    assert sounds == [bytes(640), loud] * 50
    assert turns >= len(frames) - 1
