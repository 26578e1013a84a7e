"""How much sooner an answer is heard if its first clause is spoken before its first sentence ends.

A scripted language model of known speed writes answers (four characters a token, the first
after one token's time), the voice is espeak-ng, and the time runs until its first sound. The gap
is the silence behind the first clause where the model is too slow for the rest of its sentence.

    python bench/talk/first_clause.py
"""

import asyncio
import statistics
import sys
import time
from dataclasses import dataclass
from functools import partial

from loguru import logger
from pipecat.frames.frames import (
    EndFrame,
    Frame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TTSAudioRawFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineParams, PipelineWorker
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.aggregators.llm_text_processor import LLMTextProcessor
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.workers.runner import WorkerRunner

from ico3d.chat.services.voice import espeak
from ico3d.chat.services.voice.base import PieceVoice
from ico3d.chat.services.voice.clauses import ClauseProcessor
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.cli import run_script

TOKEN = 4  # characters
ANSWERS = (
    "That is a good question, and the answer depends on how much time you have today.",
    "In the year 1969, two people walked on the moon, and the whole world was watching them.",
    "I was born in a small town by the sea where nothing much ever happened until that summer.",
    "Well, to be honest, I have never been there, but my sister told me that it is beautiful.",
    "Yes. I can help you with that if you tell me where you want to go.",
    "Natürlich, das machen wir gern, aber bitte sagen Sie uns vorher, wann Sie kommen möchten.",
)


@dataclass(frozen=True)
class FirstClause:
    """The bench.

    Attributes:
        speeds: Tokens per second of the language model; by default those of a small one on a CPU
            to those of a served one on a GPU.
    """

    speeds: tuple[int, ...] = (10, 20, 50)

    def run(self) -> None:
        """Prints a table."""
        logger.remove()  # pipecat tells of every frame
        asyncio.run(measure(self.speeds))


class ScriptedModel(FrameProcessor):
    """Writes an answer at a known speed."""

    def __init__(self, answer: str, speed: float):
        super().__init__()
        self._tokens = [answer[at : at + TOKEN] for at in range(0, len(answer), TOKEN)]
        self._speed = speed

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        await super().process_frame(frame, direction)
        if not isinstance(frame, LLMContextFrame):
            await self.push_frame(frame, direction)
            return
        await self.push_frame(LLMFullResponseStartFrame())
        began = time.monotonic()
        for number, token in enumerate(self._tokens, 1):
            await asyncio.sleep(max(0.0, began + number / self._speed - time.monotonic()))
            await self.push_frame(LLMTextFrame(token))
        await self.push_frame(LLMFullResponseEndFrame())


class Ear(FrameProcessor):
    """Notes when sound came, and how long it lasts."""

    def __init__(self):
        super().__init__()
        self.heard: list[tuple[float, float]] = []

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        await super().process_frame(frame, direction)
        if isinstance(frame, TTSAudioRawFrame):
            self.heard.append((time.monotonic(), len(frame.audio) / 2 / SPEECH_RATE))
        await self.push_frame(frame, direction)


async def spoken(answer: str, speed: float, pieces: FrameProcessor) -> tuple[float, float]:
    """Seconds from the question to the first sound, and of the gap behind the first piece."""
    ear, voice = Ear(), PieceVoice("en-us", partial(espeak.speak, voice="en-us", rate=165))
    worker = PipelineWorker(
        Pipeline([ScriptedModel(answer, speed), pieces, voice, ear]),
        params=PipelineParams(audio_out_sample_rate=SPEECH_RATE),
        enable_rtvi=False,
    )
    runner = WorkerRunner(handle_sigint=False)
    await runner.add_workers(worker)
    running = asyncio.create_task(runner.run())
    began = time.monotonic()
    await worker.queue_frames([LLMContextFrame(LLMContext()), EndFrame()])
    await running
    (first, length), *more = ear.heard
    gap = max(0.0, more[0][0] - first - length) if more else 0.0
    return first - began, gap


async def measure(speeds: tuple[int, ...]) -> None:
    """Prints a row for each speed."""
    await spoken("Warm up.", 1000, ClauseProcessor())
    print("tokens/s  by sentence  by clause  ratio: median, least, most  gap: median, most")
    for speed in speeds:
        whole = [await spoken(answer, speed, LLMTextProcessor()) for answer in ANSWERS]
        cut = [await spoken(answer, speed, ClauseProcessor()) for answer in ANSWERS]
        late, early, gaps = (
            sorted(column)
            for column in ([t for t, _ in whole], [t for t, _ in cut], [gap for _, gap in cut])
        )
        ratios = sorted(c / w for (w, _), (c, _) in zip(whole, cut, strict=True))
        middle = statistics.median
        print(
            f"{speed:8d}  {middle(late):9.2f} s  {middle(early):7.2f} s  {middle(ratios):13.2f}, "
            f"{ratios[0]:.2f}, {ratios[-1]:.2f}  {middle(gaps):9.2f}, {gaps[-1]:.2f} s"
        )


if __name__ == "__main__":
    sys.exit(run_script(FirstClause))
