import numpy as np

from ico3d.common.espeak.speech import Phoneme
from ico3d.common.visemes import VISEMES
from ico3d.speech.articulation import ARTICULATION, articulation_track, viseme_track

WORD = (
    Phoneme(0.2, "p"),
    Phoneme(0.3, "ˈɑː"),
    Phoneme(0.6, "p"),
    Phoneme(0.7, "aɪ"),
    Phoneme(0.9, ""),
)


def column(name, times, phonemes=WORD, end=1.2):
    return articulation_track(phonemes, end, times)[:, ARTICULATION.index(name)]


def test_visemes_last_until_the_next_one_begins():
    times = np.array([0.0, 0.19, 0.21, 0.29, 0.31, 0.59, 0.61, 0.71, 0.79, 0.81, 0.91, 5.0])
    names = [VISEMES[i] for i in viseme_track(WORD, 1.2, times)]
    expected = ["sil", "sil", "PP", "PP", "aa", "aa", "PP", "aa", "aa", "ih", "sil", "sil"]
    assert names == expected


def test_lips_close_in_the_middle_of_a_stop_and_open_in_the_vowel():
    times = np.arange(0, 1.2, 0.001)
    closure, opening = column("closure", times), column("opening", times)
    assert closure[250] > 0.99 and closure[650] > 0.99
    assert closure[450] < 0.01 and closure[1000] < 0.01
    assert opening[450] > 0.95 and opening[650] < 0.15
    np.testing.assert_allclose(closure[[200, 300]], 0.5, atol=0.12)  # half at its borders


def test_nothing_is_early_or_late():
    """A symmetric sound has a symmetric track."""
    sound = (Phoneme(0.5, "b"), Phoneme(0.6, "a"), Phoneme(0.8, "b"), Phoneme(0.9, ""))
    times = 0.7 + np.arange(-0.4, 0.4001, 0.005)
    track = articulation_track(sound, 2.0, times - 0.0025)  # grid steps begin, sounds do too
    np.testing.assert_allclose(track, track[::-1], atol=0.02)


def test_rounding_and_labiodentals():
    phonemes = (Phoneme(0.0, "u"), Phoneme(0.4, "f"), Phoneme(0.6, "i"))
    times = np.array([0.2, 0.5, 0.8])
    assert column("rounding", times, phonemes, 1.0)[0] > 0.95
    np.testing.assert_array_less(column("rounding", times, phonemes, 1.0)[1:], 0.05)
    assert column("labiodental", times, phonemes, 1.0).argmax() == 1
    assert column("spread", times, phonemes, 1.0).argmax() == 2


def test_silence_is_a_closed_mouth_at_rest():
    track = articulation_track((), 0.0, np.linspace(0, 1, 5))
    np.testing.assert_allclose(track, np.tile([0, 0.2, 0, 0, 0], (5, 1)), atol=1e-6)
