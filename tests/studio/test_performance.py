"""The performance: lips follow the sound without delay and close at p, b and m."""

import numpy as np
import pytest

from ico3d.common.espeak.speech import Phoneme
from ico3d.common.expression import EYE_NAMES
from ico3d.studio.acting.articulation import LEAST_CLOSED, articulate, closure
from ico3d.studio.acting.performance import PAUSE, SOUND_RATE, _glances, _speak, perform
from ico3d.studio.choice import load_subject
from support.shared import SUBJECTS

NAMES = ["sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "ih", "oh", "ou"]
JAW = {"aa": 1.0, "E": 0.6, "ih": 0.4, "oh": 0.8, "ou": 0.3}
VISEMES = {n: np.array([JAW.get(n, 0.15), float(n == "PP")], np.float32) for n in NAMES}
VISEMES["sil"] = np.zeros(2, np.float32)
VISEMES["PP"] = np.array([0.0, 1.0], np.float32)


def test_lips_are_shut_at_bilabials_whatever_is_around():
    spoken = [Phoneme(0.0, "ɑː"), Phoneme(0.3, "b"), Phoneme(0.37, "ˈɑː"), Phoneme(0.7, "m")]
    times = np.array([0.32, 0.72, 0.76])
    weights = articulate(spoken, 0.8, VISEMES, times)
    np.testing.assert_allclose(weights, [[0, 1]] * 3, atol=1e-6)
    assert articulate(spoken, 0.8, VISEMES, np.array([0.15]))[0, 0] > 0.7


@pytest.mark.parametrize("offset", np.arange(0, 0.04, 0.005))
def test_every_closure_is_seen_by_a_frame(offset):
    spoken = [Phoneme(0.0, "a"), Phoneme(0.4 + offset, "p"), Phoneme(0.44 + offset, "a")]
    frames = np.arange(25) / 25
    assert closure(spoken, 1.0, frames).max() == 1
    assert LEAST_CLOSED > 1 / 25


def test_the_mouth_is_neither_early_nor_late():
    spoken = [Phoneme(0.0, ""), Phoneme(0.5, "a"), Phoneme(0.7, "")]
    times = np.arange(0, 1.2, 0.005)
    jaw = articulate(spoken, 1.2, VISEMES, times)[:, 0]
    middle = (jaw * times).sum() / jaw.sum()
    assert abs(middle - 0.6) < 0.004


def test_a_diphthong_goes_through_both_vowels():
    spoken = [Phoneme(0.0, "aɪ")]
    start, end = articulate(spoken, 0.4, VISEMES, np.array([0.05, 0.35]))[:, 0]
    assert start > 0.8 and end < 0.5


def test_stress_and_length_marks_do_not_change_the_sound():
    plain = articulate([Phoneme(0.0, "s")], 0.3, VISEMES, np.array([0.15]))
    marked = articulate([Phoneme(0.0, "sː")], 0.3, VISEMES, np.array([0.15]))
    np.testing.assert_array_equal(plain, marked)


def test_opening_follows_the_loudness_of_real_speech_without_lag():
    random = np.random.default_rng(0)
    text = "My aunt and my uncle are far away. How are you? We want to walk on."
    samples, phonemes, said = _speak(text, 8.0, "en-us", 50, random)
    assert said.startswith("My aunt") and len(samples) == 8 * SOUND_RATE
    assert (samples[: int(0.9 * PAUSE * SOUND_RATE)] == 0).all()
    rate = 100
    times = np.arange(8 * rate) / rate
    jaw = articulate(phonemes, 8.0, VISEMES, times)[:, 0]
    loud = np.sqrt((samples.reshape(len(times), -1) ** 2).mean(axis=1))
    loud = np.convolve(loud, np.hanning(11) / 5, mode="same")
    lags = np.arange(-20, 21)
    correlation = [np.corrcoef(jaw[20:-20], np.roll(loud, lag)[20:-20])[0, 1] for lag in lags]
    assert max(correlation) > 0.5
    assert abs(int(lags[np.argmax(correlation)])) <= 3  # 30 ms


def test_a_gaze_rests_and_jumps():
    times = np.arange(1000) / 25
    gaze = _glances(times, np.random.default_rng(0))
    assert np.abs(gaze).max() <= 1 and np.ptp(gaze) > 1
    still = np.abs(np.diff(gaze)) < 1e-9
    assert 0.8 < still.mean() < 0.98  # it moves in a frame or two, then rests


NPZ = SUBJECTS / "human_face_f.npz"


@pytest.mark.skipif(not NPZ.is_file(), reason="../shared/subjects is not here")
def test_a_lively_person_says_the_same_with_more_of_the_face():
    subject = load_subject(str(NPZ))
    calm, lively = (perform(subject, "", 500, 25.0, 0, mood) for mood in (False, True))
    np.testing.assert_array_equal(calm.samples, lively.samples)
    np.testing.assert_array_equal(calm.world_from_head, lively.world_from_head)
    active = [int((p.weights.std(0) > 0.02).sum()) for p in (calm, lively)]
    assert active[0] < 30 and active[1] > 40
    assert lively.weights.min() >= 0 and lively.weights.max() <= 1
    for column, name in enumerate(EYE_NAMES):
        weights = lively.weights[:, subject.blendshape_names.index(name)]
        np.testing.assert_array_equal(lively.eyes[:, column], weights)
    both = [subject.blendshape_names.index(n) for n in ("eyeLookInLeft", "eyeLookOutRight")]
    np.testing.assert_array_equal(*lively.weights[:, both].T)
