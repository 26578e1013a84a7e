"""The built-in encoder never heard a human: here it does, against forced alignment."""

import numpy as np
import pytest
import torch

from ico3d.measure.alignment import aligned, transcripts
from ico3d.speech.articulation import ARTICULATION, articulation_track
from ico3d.speech.encoder import BUILTIN_FILE, load_encoder
from ico3d.speech.training.train_encoder import load_readout
from support.shared import SPEECH

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def heard():
    """Predicted and aligned articulation (T, 5) of all recordings, one after the other."""
    pytest.importorskip("pocketsphinx")
    soundfile = pytest.importorskip("soundfile")
    if not SPEECH.is_dir():
        pytest.skip("no recordings of human speech here (../shared/speech)")
    encoder, readout = load_encoder(), load_readout(BUILTIN_FILE)
    found, wanted = [], []
    for path, words in transcripts(SPEECH).items():
        samples, rate = soundfile.read(path, dtype="int16")
        phonemes, end = aligned(samples, words)
        features = torch.from_numpy(encoder.features(samples / 32768, rate))
        found.append(readout(features)[1].numpy())
        wanted.append(articulation_track(phonemes, end, np.arange(len(features)) / 25))
    return np.concatenate(found), np.concatenate(wanted)


def area_under_curve(scores, positive):
    ranks = np.argsort(np.argsort(scores))
    count = positive.sum()
    return (ranks[positive].sum() - count * (count - 1) / 2) / (count * (~positive).sum())


def column(tracks, name):
    return tracks[:, ARTICULATION.index(name)]


def test_lips_open_when_a_human_says_a_vowel(heard):
    found, wanted = (column(tracks, "opening") for tracks in heard)
    shifts = range(-4, 5)
    scores = [np.corrcoef(found[4 + s : len(found) - 4 + s], wanted[4:-4])[0, 1] for s in shifts]
    assert max(scores) > 0.6
    assert abs(shifts[int(np.argmax(scores))]) <= 1  # within a frame of the aligner's opinion


def test_lips_close_when_a_human_says_p_b_or_m(heard):
    found, wanted = (column(tracks, "closure") for tracks in heard)
    assert area_under_curve(found, wanted > 0.5) > 0.8
