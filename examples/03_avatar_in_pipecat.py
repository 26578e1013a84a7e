"""The avatar as one processor of an ordinary pipecat bot: sound in, sound with its face out.

Put `avatar` behind the voice of your own pipeline, whatever listens and thinks before it. It
gives `SpeechFrame`s: pieces of sound with the face's rows. Takes the extras `chat` and `voice`.

    python examples/03_avatar_in_pipecat.py --text "Hello. This is my face." --out said
"""

import asyncio
from pathlib import Path

import numpy as np
import tyro
from pipecat.frames.frames import EndFrame, Frame, TTSSpeakFrame
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineParams, PipelineWorker
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.workers.runner import WorkerRunner

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import bundle_path
from ico3d.chat.frames import SpeechFrame
from ico3d.chat.performing.expression import ExpressionProcessor
from ico3d.chat.performing.face import Face, open_face
from ico3d.chat.services.provider import Context
from ico3d.chat.services.voice import espeak


class Stage(FrameProcessor):
    """Where your bot shows the avatar; here it keeps what arrives."""

    pieces: tuple[SpeechFrame, ...] = ()

    async def process_frame(self, frame: Frame, direction: FrameDirection) -> None:
        """Takes speech, passes the rest on."""
        await super().process_frame(frame, direction)
        if isinstance(frame, SpeechFrame):
            self.pieces += (frame,)
        await self.push_frame(frame, direction)


async def main(bundle: Path = Path("demo"), text: str = "Hello.", out: Path = Path("said")) -> None:
    """Writes OUT.npz: `sound` (S,) int16 at 24 kHz, `face` (T, B), 25 rows a second."""
    person = Bundle.open(bundle_path(bundle))
    head, speech = open_face(person)
    voice = espeak.make(espeak.Settings(), Context(person.manifest.persona, head, None))
    avatar = ExpressionProcessor(Face(head, speech, seed=0))
    pipeline = Pipeline([voice, avatar, stage := Stage()])
    worker = PipelineWorker(pipeline, params=PipelineParams(audio_out_sample_rate=24_000))
    await worker.queue_frames([TTSSpeakFrame(text), EndFrame()])
    runner = WorkerRunner(handle_sigint=False)
    await runner.add_workers(worker)
    await runner.run()
    sound = np.concatenate([piece.pcm for piece in stage.pieces])
    face = np.concatenate([piece.expressions for piece in stage.pieces])
    np.savez(out.with_suffix(".npz"), sound=sound, face=face)


if __name__ == "__main__":
    asyncio.run(tyro.cli(main))
