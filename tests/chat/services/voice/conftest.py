"""Runs a voice in a pipeline of its own."""

import numpy as np
import pytest
from pipecat.frames.frames import ErrorFrame, TTSAudioRawFrame, TTSSpeakFrame
from pipecat.pipeline.worker import PipelineParams
from pipecat.tests.utils import run_test

from ico3d.chat.protocol import SPEECH_RATE


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """What would be kept for this user."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "ico3d"


@pytest.fixture
def say():
    """Has a voice say texts; returns its sound, (S,) int16 at 24 kHz, and the errors it met."""

    async def said(voice, *texts):
        down, up = await run_test(
            voice,
            frames_to_send=[TTSSpeakFrame(text) for text in texts],
            pipeline_params=PipelineParams(audio_out_sample_rate=SPEECH_RATE),
            start_timeout=60,
        )
        audio = [frame for frame in down if isinstance(frame, TTSAudioRawFrame)]
        assert {(f.sample_rate, f.num_channels) for f in audio} <= {(SPEECH_RATE, 1)}
        pcm = np.frombuffer(b"".join(frame.audio for frame in audio), np.int16)
        return pcm, [frame.error for frame in up if isinstance(frame, ErrorFrame)]

    return said
