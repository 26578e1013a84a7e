"""The built-in encoder never heard a human: here it does, against forced alignment."""

from pathlib import Path

import numpy as np
import pytest
import torch

from ico3d.common.espeak import Phoneme
from ico3d.speech.encoder import BUILTIN_FILE, load_encoder
from ico3d.speech.targets import ARTICULATION, articulation_track
from ico3d.speech.training import load_readout

SPEECH = Path(__file__).parents[3] / "shared" / "speech"
WORDS = {
    "jfk_16k": "and so my fellow americans ask not what your country can do for you "
    "ask what you can do for your country",
    "new-home-in-the-stars-16k": "we must find a new home in the stars",
    "arctic_a0024": "it was my reports from the north which chiefly induced people to buy",
}
IPA = (
    "AA ɑ AE æ AH ʌ AO ɔ AW aʊ AY aɪ EH ɛ ER ɚ EY eɪ IH ɪ IY i OW oʊ OY ɔɪ UH ʊ UW u B b CH tʃ "
    "D d DH ð F f G ɡ HH h JH dʒ K k L l M m N n NG ŋ P p R ɹ S s SH ʃ T t TH θ V v W w Y j Z z "
    "ZH ʒ"
)
SYMBOLS = dict(zip(IPA.split()[::2], IPA.split()[1::2], strict=True))


@pytest.fixture(scope="module")
def heard():
    """Predicted and aligned articulation (T, 5) of all recordings, one after the other."""
    pytest.importorskip("pocketsphinx")
    soundfile = pytest.importorskip("soundfile")
    if not SPEECH.is_dir():
        pytest.skip("no recordings of human speech here (../shared/speech)")
    encoder, readout = load_encoder(), load_readout(BUILTIN_FILE)
    found, wanted = [], []
    for name, words in WORDS.items():
        samples, rate = soundfile.read(SPEECH / f"{name}.wav", dtype="int16")
        phonemes, end = aligned(samples, words)
        features = torch.from_numpy(encoder.features(samples / 32768, rate))
        found.append(readout(features)[1].numpy())
        wanted.append(articulation_track(phonemes, end, np.arange(len(features)) / 25))
    return np.concatenate(found), np.concatenate(wanted)


def aligned(samples, words):
    from pocketsphinx import Decoder

    decoder = Decoder(loglevel="FATAL", bestpath=False)
    decoder.set_align_text(words)
    for _ in range(2):  # words, then the phones inside them
        decoder.start_utt()
        decoder.process_raw(samples.tobytes(), full_utt=True)
        decoder.end_utt()
        phones = [phone for word in decoder.get_alignment() or () for phone in word]
        decoder.set_alignment()
    phonemes = [Phoneme(p.start / 100, SYMBOLS.get(p.name, "")) for p in phones]
    return phonemes, (phones[-1].start + phones[-1].duration) / 100


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
