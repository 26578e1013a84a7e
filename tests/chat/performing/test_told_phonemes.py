"""Phonemes that a voice tells move the lips of the talk."""

import numpy as np
import pytest
import torch
from pipecat.frames.frames import TTSAudioRawFrame, TTSStoppedFrame
from pipecat.tests.utils import run_test

from ico3d.chat.frames import PhonemesFrame, SpeechFrame
from ico3d.chat.performing.expression import ExpressionProcessor
from ico3d.chat.performing.face import ROW, Face
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.espeak.speech import Phoneme
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech
from ico3d.speech.network import SpeechAdaptor
from ico3d.speech.runtime import SpeechModel, StreamingExpressions
from support.bundles.random_bundle import random_head, random_manifest

VOWEL_AND_STOP = (Phoneme(0.0, "a"), Phoneme(0.36, "b"), Phoneme(0.44, "a"))
SECONDS = 0.8


@pytest.fixture(scope="module")
def model():
    torch.manual_seed(0)
    encoder = load_encoder()
    return SpeechModel(export_speech(SpeechAdaptor(encoder.size), encoder))


async def test_each_stretch_has_its_own_phonemes(model):
    random = np.random.default_rng(0)
    stretches = [random.integers(-3000, 3000, 20 * ROW).astype(np.int16) for _ in range(2)]
    frames = []
    for number, pcm in enumerate(stretches):
        if number == 1:
            frames.append(PhonemesFrame(VOWEL_AND_STOP, SECONDS))
        frames.append(TTSAudioRawFrame(pcm.tobytes(), SPEECH_RATE, 1))
    processor = ExpressionProcessor(Face(random_manifest(random_head(10)).head, model, 0))
    down, _ = await run_test(processor, frames_to_send=[*frames, TTSStoppedFrame()])
    found = np.concatenate([f.expressions for f in down if isinstance(f, SpeechFrame)])[:, :32]
    expected, heard = (rows_of(model, stretches, tells) for tells in (True, False))
    np.testing.assert_allclose(found, expected[: len(found)], atol=1e-5)
    changed = np.abs(expected - heard).max(1)[: len(found)]
    assert changed[:16].max() < 1e-6 < changed[22:38].min()


def rows_of(model, stretches, tells):
    stream, rows = StreamingExpressions(model, SPEECH_RATE), []
    for number, pcm in enumerate(stretches):
        if tells and number == 1:
            stream.tell(VOWEL_AND_STOP, SECONDS)
        rows.append(stream.push(pcm.astype(np.float32) / 32768))
    return np.concatenate([*rows, stream.finish()])
