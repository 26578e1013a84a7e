"""A mouth that rests where nobody speaks: at the packaged avatar, and at any encoder."""

import numpy as np
import pytest

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.packaged import FILE
from ico3d.common.espeak.speech import synthesize
from ico3d.speech.runtime import SpeechModel, StreamingExpressions
from ico3d.speech.silence import SilenceGate

RATE = 24000


@pytest.fixture(scope="module")
def demo():
    if not FILE.is_file():
        pytest.skip("no packaged avatar")
    bundle = Bundle.open(FILE)
    idle = np.array(bundle.manifest.head.idle_expression, np.float32)[:32]
    return SpeechModel(bundle.read(SPEECH)), idle


@pytest.fixture(scope="module")
def words():
    pytest.importorskip("espeakng_loader")
    soxr = pytest.importorskip("soxr")
    speech = synthesize("Hello there, how are you all?")
    return soxr.resample(speech.samples, speech.rate, RATE).astype(np.float32)


def streamed(model, samples, piece=RATE * 16 // 100):
    stream = StreamingExpressions(model, RATE)
    rows = [stream.push(samples[at : at + piece]) for at in range(0, len(samples), piece)]
    return np.concatenate([*rows, stream.finish()])


def away(rows, idle):
    return np.linalg.norm(rows - idle, axis=1)


def noise(decibel, seconds=2.0, colour=0.0):
    white = np.fft.rfft(np.random.default_rng(0).normal(size=int(seconds * RATE)))
    shaped = np.fft.irfft(white / np.maximum(np.linspace(0, RATE / 2, len(white)), 50) ** colour)
    return (shaped / shaped.std() * 10 ** (decibel / 20)).astype(np.float32)


def test_digital_silence_is_the_idle_mouth_to_the_last_row(demo):
    model, idle = demo
    rows = streamed(model, np.zeros(2 * RATE, np.float32))
    assert len(rows) == 51
    np.testing.assert_allclose(rows, np.tile(idle, (51, 1)), atol=1e-4)


@pytest.mark.parametrize("colour", [0.0, 1.0])
def test_low_noise_is_the_idle_mouth(demo, words, colour):
    model, idle = demo
    speaking = np.median(away(streamed(model, words), idle))
    assert speaking > 0.2
    assert away(streamed(model, noise(-62, colour=colour)), idle).max() < 1e-3 * speaking
    assert away(streamed(model, noise(-57, colour=colour)), idle).max() < 0.2 * speaking


def test_the_mouth_closes_soon_after_speech(demo, words):
    model, idle = demo
    end = len(words) / RATE
    speaking = np.median(away(streamed(model, words), idle))
    quiet = noise(-65, 1.5)
    rows = away(streamed(model, np.concatenate([words, quiet])), idle) / speaking
    assert rows[: int(end * 25)].max() > 1
    assert rows[int((end + 0.25) * 25) + 1 :].max() < 1e-3
    before = away(streamed(model, np.concatenate([quiet, words])), idle) / speaking
    assert before[: int(1.3 * 25)].max() < 1e-3


def test_speech_itself_is_untouched(demo, words):
    model, _ = demo
    stream = model.stream(RATE)
    inputs = np.concatenate([stream.push(words), stream.finish()])
    plain = model.run(inputs)  # without the gate, zeros around
    rows = model.expressions(words, RATE)
    count, reach = len(rows), RATE // 10  # a row's level is that of 0.2 s around
    middles = [int((row + 0.5) * RATE / 25) for row in range(count)]
    around = [words[max(0, middle - reach) : middle + reach] for middle in middles]
    level = np.array([np.sqrt((part**2).sum() / (2 * reach)) for part in around])
    loud = (level > 10 ** (-45 / 20)) & (np.arange(count) > 3) & (np.arange(count) < count - 3)
    assert loud.mean() > 0.7
    np.testing.assert_allclose(rows[loud], plain[loud], atol=1e-5)


@pytest.mark.parametrize("rate", [8000, 16000, 22050, 24000, 44100])
@pytest.mark.parametrize("piece", [37, 4000])
def test_gains_of_pieces_are_those_of_the_level_around(rate, piece):
    samples = np.concatenate([noise(level, 0.6) for level in (-70, -56, -20, -54, -70)])[:rate]
    gate, found, given = SilenceGate(rate), [], 0
    for at in range(0, len(samples), piece):
        gate.push(samples[at : at + piece])
        known = int((at + piece) / rate * 25) - 2
        if known > given and at + piece <= len(samples):
            found.append(gate.gains(given, known - given))
            given = known
    gate.finish()
    found = np.concatenate([*found, gate.gains(given, 26 - given)])
    edges = [int(row * rate // 25) for row in range(-2, 30)]
    padded = np.concatenate([np.zeros(edges[2] - edges[0]), samples, np.zeros(rate)]).astype(float)
    for row in range(26):
        part = padded[edges[row] - edges[0] : edges[row + 5] - edges[0]]
        level = 10 * np.log10((part**2).sum() / (0.2 * rate) + 1e-12)
        share = min(max((level + 60) / 10, 0), 1)
        assert found[row] == pytest.approx(share * share * (3 - 2 * share), abs=1e-5)
