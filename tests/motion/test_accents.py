"""Where speech is stressed, which words call for which gesture, and when a listener nods."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.motion.composing import accents as module
from ico3d.motion.composing.accents import (
    FRAME,
    GrowingAccents,
    GrowingLoudness,
    Word,
    accents,
    loudness,
    smoothed,
    timed_words,
    unknown_words,
)
from ico3d.motion.composing.lexicon import meanings, requested, stressed
from ico3d.motion.composing.listening import APART, Listener

RATE = 16_000


def spoken(*syllables: tuple[float, float], seconds: float) -> np.ndarray:
    """Sound with syllables (second of the middle, loudness 0 … 1), 0.16 s each."""
    times = np.arange(int(seconds * RATE)) / RATE
    level = sum(peak * np.clip(1 - np.abs(times - at) / 0.08, 0, 1) for at, peak in syllables)
    return (level * np.sin(2 * np.pi * 180 * times)).astype(np.float32)


def words_of(*spans: tuple[str, float, float]) -> tuple[Word, ...]:
    return tuple(Word(*span) for span in spans)


def test_loudness_is_in_decibels_of_the_sound_around():
    times = np.arange(RATE) / RATE
    level = loudness(0.5 * np.sin(2 * np.pi * 400 * times), RATE)
    assert len(level) == 100
    np.testing.assert_allclose(level[5:-5], 20 * np.log10(0.5 / np.sqrt(2)), atol=0.05)
    np.testing.assert_array_equal(loudness(np.zeros(RATE), RATE), -80)


def test_the_accent_of_a_word_is_its_loudest_syllable():
    sound = spoken((0.3, 0.5), (0.55, 0.9), (0.9, 0.7), seconds=1.3)
    words = words_of(("about", 0.2, 0.65), ("trees", 0.8, 1.0))
    found = accents(words, loudness(sound, RATE), True)
    assert [a.word for a in found] == [0, 1]
    np.testing.assert_allclose([a.time for a in found], [0.55, 0.9], atol=0.015)
    assert found[0].strength == 0 and -4 < found[1].strength < -1


def test_more_sound_does_not_change_accents():
    rng = np.random.default_rng(4)
    beats = [(0.25 + 0.3 * i, float(p)) for i, p in enumerate(rng.uniform(0.2, 0.9, 18))]
    level = loudness(spoken(*beats, seconds=6), RATE)
    words = tuple(Word("word", 0.1 + 0.3 * i, 0.4 + 0.3 * i) for i in range(18))
    whole = accents(words, level, True)
    assert len(whole) >= 15
    for known in range(60, 600, 37):
        part = accents(words, level[:known], False)
        assert part == whole[: len(part)]
        assert all(word.end < known * FRAME for word in words[: part[-1].word + 1])


def test_asking_again_and_again_finds_the_same_and_looks_at_each_word_once(monkeypatch):
    rng = np.random.default_rng(5)
    level = np.repeat(rng.uniform(-60, -10, 1200), 10)  # 120 s
    words = tuple(Word("word", 0.3 * i, 0.3 * i + 0.28) for i in range(400))
    looked = []
    monkeypatch.setattr(
        module, "smoothed", lambda levels: looked.append(len(levels)) or smoothed(levels)
    )
    growing = GrowingAccents()
    for known in range(0, 12_000, 10):
        found = growing.up_to(words[: known // 20], level[:known], False)
        for _ in range(3):
            assert growing.up_to(words[: known // 20], level[:known], False) == found
    assert max(looked) < 600  # frames: the sound of some seconds, never all of it
    assert growing.up_to(words, level, True) == accents(words, level, True)


def test_silence_has_no_accents():
    assert accents(words_of(("word", 0, 0.5)), np.zeros(0), True) == ()
    assert accents(words_of(("word", 0, 0.5)), np.full(100, -80.0), True) == ()
    assert smoothed(np.full(9, -80.0)) == pytest.approx(-80)


def test_words_share_the_time_in_which_there_is_sound():
    sound = np.concatenate(
        [spoken((0.1, 0.8), (0.3, 0.8), (0.5, 0.8), seconds=0.6), np.zeros(RATE)]
    )
    sound = np.concatenate([sound, spoken((0.1, 0.8), (0.3, 0.8), (0.5, 0.8), seconds=0.6)])
    words = timed_words("banana – banana!", loudness(sound, RATE), 0.0, 2.2)
    assert [word.text for word in words] == ["banana", "banana!"]
    np.testing.assert_allclose([words[0].begin, words[0].end], [0, 0.6], atol=0.12)
    np.testing.assert_allclose([words[1].begin, words[1].end], [1.6, 2.2], atol=0.12)
    assert timed_words("...", loudness(sound, RATE), 0.0, 2.2) == ()
    assert timed_words("word", loudness(sound, RATE), 2.2, 2.2) == ()


def said(text: str) -> tuple[Word, ...]:
    return tuple(Word(word, i, i + 1) for i, word in enumerate(text.split()))


def test_words_and_phrases_mean_gestures():
    assert meanings(said("Hello, I don't know THREE of you.")) == {
        0: "wave",
        3: "shrug",
        4: "count_three",
        6: "open_hand",
    }
    assert [stressed(word) for word in said("the green house, and I")] == [
        *(False, True, True, False, False)
    ]


@pytest.mark.parametrize(
    ("text", "gesture"),
    [
        ("Can you wave at me?", "wave"),
        ("Could you please shake your head?", "shake"),
        ("wave!", "wave"),
        ("Would you count to three for us", "count_three"),
        ("Please put your hand on your heart.", "hand_on_heart"),
        ("Don't wave, please", None),
        ("A heat wave is coming.", None),
        ("Why do people wave?", None),
        ("How are you?", None),
    ],
)
def test_a_visitor_asks_for_a_gesture(text, gesture):
    assert requested(text) == gesture


def test_a_listener_nods_in_pauses_only_and_not_too_often():
    speech = np.tile(np.concatenate([np.full(150, -20.0), np.full(50, -70.0)]), 20)
    whole = Listener(3).hear(speech)
    times = np.array([seconds for seconds, _ in whole])
    assert 5 <= len(times) <= 14 and np.diff(times).min() >= APART
    np.testing.assert_allclose(times % 2.0, 1.75, atol=0.011)
    assert {name for _, name in whole} <= {"nod", "small_nod"}
    pieces = Listener(3)
    assert [nod for i in range(0, 4000, 33) for nod in pieces.hear(speech[i : i + 33])] == whole
    assert Listener(4).hear(speech) != whole
    assert Listener(3).hear(np.full(4000, -70.0)) == []


@given(st.integers(0, 1000), st.sampled_from([16_000, 22_050, 24_000]))
@settings(max_examples=10)
def test_loudness_is_the_same_in_whatever_pieces_sound_comes(seed, rate):
    random = np.random.default_rng(seed)
    samples = random.normal(size=rate) * np.repeat(random.uniform(0, 0.3, 10), rate // 10)[:rate]
    growing = GrowingLoudness(rate)
    for piece in np.split(samples, np.sort(random.integers(0, rate, 12))):
        growing.push(piece)
    whole = loudness(samples, rate)
    assert 0 <= len(whole) - len(growing.levels) <= 2
    np.testing.assert_allclose(growing.levels, whole[: len(growing.levels)], atol=1e-6)


def test_words_that_nobody_wrote_down_mean_nothing():
    """As many as fill the sound, with accents like any."""
    levels = np.full(300, -80.0)
    levels[50:260] = -20 + 5 * np.sin(np.arange(210) / 5)
    words = unknown_words(levels)
    assert len(words) == 6 and all(stressed(word) for word in words)
    assert words[0].begin == pytest.approx(0.5) and words[-1].end == pytest.approx(2.6)
    assert meanings(words) == {} and len(accents(words, levels, True)) >= 4
    silence = np.full(50, -80.0)
    assert accents(unknown_words(silence), silence, True) == ()
