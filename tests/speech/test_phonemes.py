import numpy as np
import pytest
import torch

from ico3d.common.espeak.speech import Phoneme
from ico3d.speech.articulation import ARTICULATION, articulation_track
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech
from ico3d.speech.mel import mel_windows
from ico3d.speech.network import SpeechAdaptor
from ico3d.speech.phonemes import TimedPhonemes
from ico3d.speech.runtime import SpeechModel, StreamingExpressions

SOUND = (Phoneme(0.1, "a"), Phoneme(0.5, "b"), Phoneme(0.7, "i"))


@pytest.fixture(scope="module")
def encoder():
    return load_encoder()


@pytest.fixture(scope="module")
def told(encoder):
    """A model whose expressions begin with the articulation that its encoder's features tell."""
    torch.manual_seed(0)
    adaptor, (weight, bias) = SpeechAdaptor(encoder.size), encoder.articulation
    with torch.no_grad():
        for parameter in adaptor.adaptor.parameters():
            parameter.zero_()
        adaptor.lips[: len(bias), 2 * encoder.size : 3 * encoder.size] = weight
        adaptor.lips_rest[: len(bias)] = bias
    return SpeechModel(export_speech(adaptor, encoder))


def noise(seconds, seed=0):
    samples = np.random.default_rng(seed).normal(0, 0.1, int(16000 * seconds))
    return samples.astype(np.float32)


def test_rows_are_known_where_a_voice_told_them():
    phonemes = TimedPhonemes()
    assert phonemes.rows(0, 50) is None
    phonemes.add(SOUND, 0.0, 1.0)
    phonemes.add((Phoneme(0.0, "m"),), 1.4, 0.2)
    rows = phonemes.rows(-4, 54)
    known = np.zeros(54)
    known[[*range(4, 29), *range(39, 44)]] = 1
    np.testing.assert_array_equal(rows[:, 5], known)
    np.testing.assert_array_equal(rows[known == 0, :5], 0)
    times = np.arange(25) / 25
    expected = articulation_track((*SOUND, Phoneme(1.0, ""), Phoneme(1.4, "m")), 1.6, times)
    np.testing.assert_allclose(rows[4:29, :5], expected, atol=1e-6)
    assert rows[41, ARTICULATION.index("closure")] > 0.9
    assert phonemes.rows(100, 10) is None


def test_what_lies_behind_a_stretch_is_left_out():
    phonemes = TimedPhonemes()
    phonemes.add((Phoneme(0.0, "a"), Phoneme(0.9, "b")), 0.0, 0.5)
    assert phonemes.rows(0, 12)[:, ARTICULATION.index("closure")].max() < 0.05


def test_expressions_tell_what_is_known_instead_of_what_is_heard(told):
    windows = mel_windows(noise(1.0), 16000)
    heard = told.run(windows)
    known = np.random.default_rng(1).random((len(windows), 6)).astype(np.float32)
    known[:, 5] = np.arange(len(windows)) % 3 / 2
    found = told.run(windows, known)
    part = known[:, 5:]
    expected = (1 - part) * heard[:, :5] + part * known[:, :5]
    np.testing.assert_allclose(found[:, :5], expected, atol=2e-3)
    np.testing.assert_allclose(told.run(windows, 0 * known), heard, atol=1e-5)


def test_lips_close_for_a_told_b_in_time_whatever_the_sound_is(told):
    stream = StreamingExpressions(told, 24000)
    stream.tell(SOUND, 1.0)
    loud = np.concatenate([stream.push(noise(1.5)[:24000]), stream.finish()])
    closure = loud[:25, ARTICULATION.index("closure")]
    assert abs(closure.argmax() / 25 - 0.6) <= 0.04 and closure.max() > 0.9
    opening = loud[:25, ARTICULATION.index("opening")]
    assert opening[8] > 0.8 and opening[15] < 0.2


def test_pieces_with_phonemes_give_the_rows_of_the_whole(told):
    samples, rows = noise(2.0), []
    for piece in (17500, 2500):
        stream, found = StreamingExpressions(told, 16000), []
        stream.tell(SOUND, 1.0)
        for at in range(0, len(samples), piece):
            if at == 17500:
                stream.tell((Phoneme(0.0, "u"),), 0.5)
            found.append(stream.push(samples[at : at + piece]))
        rows.append(np.concatenate([*found, stream.finish()]))
    np.testing.assert_allclose(rows[1], rows[0], atol=1e-5)
    rounding = rows[1][:, ARTICULATION.index("rounding")]
    assert rounding[30:36].min() > 0.9 > rounding[:24].max()


def test_an_encoder_without_a_readout_takes_no_phonemes():
    torch.manual_seed(0)
    encoder = load_encoder()
    plain = type(encoder)(encoder.name, encoder.size, "", encoder.network)
    model = SpeechModel(export_speech(SpeechAdaptor(encoder.size), plain))
    assert not model.takes_phonemes
    windows = mel_windows(noise(0.5), 16000)
    known = np.ones((len(windows), 6), np.float32)
    np.testing.assert_array_equal(model.run(windows, known), model.run(windows))
