"""Sentences quote what anybody may have written: they stay one line that a terminal can show."""

import pickle

import pytest

from ico3d.errors import MOST_LETTERS, BundleError, CaptureError, Ico3dError


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a.json: 'Zoë' is unknown.", "a.json: 'Zoë' is unknown."),
        ("two\nlines.", "two\\nlines."),
        ("\x1b[2J\ud800.", "\\x1b[2J\\ud800."),
    ],
)
def test_what_no_terminal_may_obey_is_escaped(text, shown):
    assert str(Ico3dError(text)) == shown
    assert str(pickle.loads(pickle.dumps(BundleError(text)))) == shown


def test_a_text_with_a_name_stands_amid_what_a_terminal_adds_and_travels():
    error = CaptureError.of("faceless", "a.mp4: ", " Go on.", {"n": 6})
    said = "no face is found in any of the 6 pictures: film one person who looks towards the camera"
    assert str(error) == f"a.mp4: {said}. Go on."
    again = pickle.loads(pickle.dumps(error))
    assert (again.code, again.values, str(again)) == ("faceless", {"n": 6}, str(error))
    assert (Ico3dError("a.").code, Ico3dError("a.").values) == ("", {})


def test_long_quotations_leave_their_middle_out():
    sentence = str(BundleError(f"begin {'a' * 10_000} mend it so."))
    assert sentence.startswith("begin aaa") and sentence.endswith("aaa mend it so.")
    assert len(sentence) == MOST_LETTERS + 3 and " … " in sentence
    assert str(BundleError("a" * MOST_LETTERS)) == "a" * MOST_LETTERS
