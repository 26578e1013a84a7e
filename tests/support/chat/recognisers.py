"""Recognisers that say what a test wants, and avatars that greet nobody."""

import asyncio
from dataclasses import dataclass, replace

from pipecat.frames.frames import TranscriptionFrame
from pipecat.services.stt_service import SegmentedSTTService
from pipecat.utils.time import time_now_iso8601


@dataclass(frozen=True)
class Script:
    """What the recogniser says to each stretch of speech, and how long it takes."""

    delay: float
    words: tuple[str, ...]


class Scripted(SegmentedSTTService):
    """A recogniser of pipecat's kind: nothing where it heard nothing."""

    def __init__(self, script: Script, **rest):
        super().__init__(**rest)
        self.script, self.stretches = script, 0

    async def run_stt(self, audio):
        self.stretches += 1
        await asyncio.sleep(self.script.delay)
        words = self.script.words[self.stretches - 1]
        if words == "fails":
            raise RuntimeError("no reason")
        if words:
            yield TranscriptionFrame(words, "", time_now_iso8601())


def silent(avatar):
    """Greets nobody."""
    return replace(avatar, persona=replace(avatar.persona, greeting=""))
