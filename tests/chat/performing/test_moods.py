"""Brows and a smile that follow a mood."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.chat.performing.moods import EASE, FACES, WITH_GESTURES, Moods, face_of
from ico3d.common.expression import EYE_NAMES, FACE_NAMES
from ico3d.motion.composing.lexicon import lexicon


def rows(count, start=0.0):
    return start + np.arange(count) / 25


def test_a_mood_eases_in_from_the_next_row_and_stays():
    moods = Moods()
    assert not moods.values(rows(50)).any()
    moods.set("serious")
    values = moods.values(rows(25, 2.0))
    assert values.shape == (25, len(FACE_NAMES)) and not values[0].any()
    assert values[round(EASE * 25) :] == pytest.approx(np.tile(face_of("serious"), (15, 1)))
    assert (np.diff(values[:11, 0]) > 0).all()
    assert moods.values(rows(5, 3.0)) == pytest.approx(np.tile(face_of("serious"), (5, 1)))


def test_it_ends_with_the_utterance_and_eases_to_another_before():
    moods = Moods()
    moods.set("surprised")
    moods.values(rows(25))
    moods.set("neutral")
    values = moods.values(rows(25, 1.0))
    assert values[0] == pytest.approx(face_of("surprised")) and not values[-1].any()
    moods.set("happy")
    moods.forget()
    assert not moods.values(rows(25, 2.0)).any()


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(list(FACES)), st.integers(0, 20)), max_size=12))
def test_moods_never_jump_however_they_are_cut(changes):
    moods, made, at = Moods(), [np.zeros((1, len(FACE_NAMES)))], 0
    for name, count in changes:
        moods.set(name)
        made.append(moods.values(rows(count, at / 25)))
        at += count
    values = np.concatenate(made)
    for part, most in ((values[:, : len(EYE_NAMES)], 0.6), (values[:, len(EYE_NAMES) :], 1.0)):
        assert np.abs(np.diff(part, axis=0)).max(initial=0) <= most * 1.5 / (EASE * 25) + 1e-6
        assert part.min() >= 0 and part.max() <= most + 1e-6


SMILE = FACE_NAMES.index("smile")


def test_a_sentence_that_greets_smiles_and_the_next_ones_less_and_less():
    moods = Moods()
    moods.hear("Hello, I am Iris.")
    assert moods.values(rows(25))[-1, SMILE] == pytest.approx(FACES["happy"]["smile"])
    moods.hear("I live in your browser.")
    assert moods.values(rows(25, 1.0))[-1] == pytest.approx(0.5 * face_of("happy"))
    moods.hear("It has no server.")
    assert moods.values(rows(25, 2.0))[-1] == pytest.approx(0.25 * face_of("happy"))
    moods.hear("Perhaps; I don't know.")
    assert moods.values(rows(25, 3.0))[-1] == pytest.approx(face_of("doubtful"))


def test_a_mood_that_was_chosen_stays_whatever_is_said():
    moods = Moods()
    moods.set("serious")
    moods.hear("Hello and welcome!")
    assert moods.values(rows(25))[-1] == pytest.approx(face_of("serious"))
    moods.forget()
    moods.hear("Welcome!")
    assert moods.values(rows(25, 2.0))[-1] == pytest.approx(face_of("happy"))


def test_moods_of_gestures_are_known():
    assert set(WITH_GESTURES.values()) <= set(FACES)
    assert set(WITH_GESTURES) <= lexicon().gestures


def test_eyes_narrow_in_a_smile_and_no_mood_shuts_them():
    lids = [FACE_NAMES.index(name) for name in ("eyeBlinkLeft", "eyeBlinkRight")]
    narrowed = {name: face_of(name)[lids].tolist() for name in FACES}
    assert all(left == right <= 0.3 for left, right in narrowed.values())
    assert [name for name, values in narrowed.items() if any(values)] == ["happy"]
    assert not face_of("neutral").any()
