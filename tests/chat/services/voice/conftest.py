"""Runs a voice in a pipeline of its own."""

import numpy as np
import pytest
from pipecat.frames.frames import ErrorFrame, TTSAudioRawFrame, TTSSpeakFrame
from pipecat.pipeline.worker import PipelineParams
from pipecat.tests.utils import run_test

from ico3d.chat.wire.protocol import SPEECH_RATE


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """The home of a user who has nothing."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    return tmp_path / "home"


@pytest.fixture
def models(home):
    """Where that user's weights lie."""
    folder = home / ".cache" / "ico3d" / "models"
    folder.mkdir(parents=True)
    return folder


@pytest.fixture(scope="session")
def fake():
    """A stand-in of OpenVoice's documented API; needs torch."""
    from support.chat import fake_openvoice

    return fake_openvoice


@pytest.fixture
def installed(fake, monkeypatch, models):
    """The fake is installed; gives the folder of its weights."""
    from ico3d.chat.services.voice import openvoice

    fake.install(monkeypatch)
    fake.write_weights(models)
    openvoice.engine.cache_clear()
    return models


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
