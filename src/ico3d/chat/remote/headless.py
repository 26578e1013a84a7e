"""Runs a service of the conversation alone: frames in, frames out."""

import asyncio
import time
from collections.abc import AsyncGenerator, Callable, Iterable, Iterator
from itertools import chain, islice
from typing import Protocol, runtime_checkable

from pipecat.frames.frames import CancelFrame, EndFrame, ErrorFrame, Frame
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineParams, PipelineWorker
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.workers.runner import WorkerRunner

from ico3d.chat.wire.protocol import MICROPHONE_RATE, SPEECH_RATE
from ico3d.errors import ServiceError

BATCH = 32
"""Frames that are handed over at once, of sound one second: pipecat's processors give nobody else a
turn while frames wait for them."""
MOST_AHEAD = 20.0
"""Seconds of sound that may wait within a service before it gets more."""


@runtime_checkable
class KeepsWaiting(Protocol):
    """A service that takes sound faster than it works on it."""

    @property
    def waiting(self) -> float:
        """Seconds of sound that it has taken and not yet worked on."""
        ...


class Collector(FrameProcessor):
    """The end of the pipeline, which collects the frames that arrive."""

    def __init__(self, found: asyncio.Queue[Frame | None]):
        """Puts frames into the queue `found`."""
        super().__init__()
        self._found = found

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Collects frames that come down the pipeline."""
        await super().process_frame(frame, direction)
        if direction == FrameDirection.DOWNSTREAM:
            self._found.put_nowait(frame)
        await self.push_frame(frame, direction)


async def run(
    processor: FrameProcessor, frames: Iterable[Frame], seconds: float
) -> AsyncGenerator[Frame, None]:
    """Runs a service on some frames; yields its output while it is produced.

    The service cannot be used again afterwards. pipecat guarantees that a service has finished all
    work when it passes an `EndFrame` on.

    Args:
        processor: A service that was not used before.
        frames: The input.
        seconds: Time limit for everything.

    Raises:
        ServiceError: If the service reports an error.
        TimeoutError: If the time limit is exceeded.
    """
    deadline = time.monotonic() + seconds
    found: asyncio.Queue[Frame | None] = asyncio.Queue()
    pipeline = Pipeline([processor, Collector(found)])
    worker = PipelineWorker(
        pipeline,
        params=PipelineParams(
            audio_in_sample_rate=MICROPHONE_RATE, audio_out_sample_rate=SPEECH_RATE
        ),
        enable_rtvi=False,
        enable_turn_tracking=False,
        idle_timeout_secs=None,
    )

    async def failed(_: FrameProcessor, error: ErrorFrame) -> None:
        found.put_nowait(error)

    processor.add_event_handler("on_error", failed)
    runner = WorkerRunner(handle_sigint=False, handle_sigterm=False)
    await runner.add_workers(worker)
    task = asyncio.create_task(runner.run())
    task.add_done_callback(lambda _: found.put_nowait(None))
    feeding = asyncio.create_task(_feed(worker, processor, chain(frames, [EndFrame()])))
    try:
        while True:
            # one wait at a time: whoever streams this may go on in another task
            frame = await asyncio.wait_for(found.get(), deadline - time.monotonic())
            if isinstance(frame, EndFrame):
                return
            if frame is None:
                raise ServiceError("the service ended by itself.")
            if isinstance(frame, ErrorFrame):
                raise ServiceError(frame.error)
            yield frame
    finally:
        feeding.cancel()
        # past the worker, which waits for its EndFrame before it takes anything else
        await pipeline.queue_frame(CancelFrame())
        await worker.cancel()
        await asyncio.gather(task, feeding, return_exceptions=True)


async def _feed(worker: PipelineWorker, processor: FrameProcessor, frames: Iterator[Frame]) -> None:
    """Hands frames over no faster than the service takes them, and others get their turns."""
    while batch := list(islice(frames, BATCH)):
        while isinstance(processor, KeepsWaiting) and processor.waiting > MOST_AHEAD:
            await asyncio.sleep(0.02)
        await worker.queue_frames(batch)
        await asyncio.sleep(0)


class Spares:
    """Creates services in advance: each request gets a new one, and one is always ready."""

    def __init__(self, make: Callable[[], FrameProcessor]):
        """`make` creates a service; it may take a while and runs in a thread."""
        self._make = make
        self._next: asyncio.Task[FrameProcessor] | None = None

    async def take(self) -> FrameProcessor:
        """A service that was not used before.

        Raises:
            Ico3dError: If the service cannot be created.
        """
        taken, self._next = self._next or self._start(), None
        try:
            return await taken
        finally:
            self._next = self._start()

    def _start(self) -> asyncio.Task[FrameProcessor]:
        task = asyncio.create_task(asyncio.to_thread(self._make))
        task.add_done_callback(lambda done: done.cancelled() or done.exception())  # seen
        return task
