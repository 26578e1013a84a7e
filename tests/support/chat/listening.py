"""Lets a recogniser hear stretches of speech, as the pipeline of a conversation does."""

import time

import numpy as np
from pipecat.frames.frames import (
    ErrorFrame,
    InputAudioRawFrame,
    TranscriptionFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.pipeline.worker import PipelineParams
from pipecat.tests.utils import run_test

from ico3d.chat.services.provider import Context

NOBODY = Context(None, None, None)


async def listen(service, *stretches):
    """Final transcripts of stretches of int16 samples, and the errors on the way."""
    frames = []
    for pcm in stretches:
        frames.append(VADUserStartedSpeakingFrame(start_secs=0.2))
        frames += [InputAudioRawFrame(part.tobytes(), 16000, 1) for part in np.split(pcm, 8)]
        frames.append(VADUserStoppedSpeakingFrame(stop_secs=0.2, timestamp=time.time()))
    params = PipelineParams(audio_in_sample_rate=16000)
    down, up = await run_test(service, frames_to_send=frames, pipeline_params=params)
    return (
        [frame for frame in down if isinstance(frame, TranscriptionFrame)],
        [frame.error for frame in up if isinstance(frame, ErrorFrame)],
    )


def noise(seconds=1.0):
    return np.random.default_rng(0).integers(-3000, 3000, int(seconds * 16000)).astype(np.int16)
