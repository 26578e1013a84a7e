import json
from pathlib import Path

import pytest

from ico3d.creating.looking.advice import Advice, spans_of, when
from ico3d.creating.looking.texts import TEXTS

WORDS = Path(__file__).parents[3] / "viewer" / "src" / "words"


def test_moments_that_lie_close_are_one_span():
    assert spans_of([7.5, 1.0, 1.5, 2.0, 7.0], 0.6) == ((1.0, 2.0), (7.0, 7.5))
    assert spans_of([], 1.0) == ()
    many = spans_of(range(0, 9000, 3), 1.0)  # all of a film of hours
    assert len(many) == 40 and many[-1] == (117, 117)


def test_seconds_are_told_before_the_text():
    advice = Advice("lips-still", spans=((3.1, 3.2), (7.0, 9.2)))
    assert str(advice) == "at 3 s and 7 to 9 s: the lips hardly move: read something aloud."
    assert str(Advice("lips-still")) == "the lips hardly move: read something aloud."


def test_a_code_begins_with_its_topic_and_values_stand_in_the_text():
    advice = Advice("rate-slow", values={"n": 9})
    assert advice.topic == "rate" and advice.text.startswith("there are 9 pictures per second:")
    assert Advice("blur").topic == "blur"


@pytest.mark.parametrize("code", TEXTS)
def test_the_page_says_every_advice_in_its_languages(code):
    """In English as here; that no language lacks a value is tested with the page's words."""
    words = json.loads((WORDS / "studio.json").read_text("utf-8"))
    said, languages = words[f"studio.advice.{code}"], words["studio.title"].keys()
    assert said.keys() == languages and len(set(said.values())) == len(languages) == 6
    assert said["en"] == TEXTS[code][0].upper() + TEXTS[code][1:]


def test_the_page_says_no_advice_that_is_never_given():
    words = json.loads((WORDS / "studio.json").read_text("utf-8"))
    there = {key.removeprefix("studio.advice.") for key in words if ".advice." in key}
    assert there - TEXTS.keys() == {"title", "at", "more"}


def test_of_many_spans_the_first_are_told():
    assert when([(i, i) for i in range(6)]) == "at 0 s, 1 s, 2 s, 3 s and 2 more times"
    assert when([(1, 1), (2, 2), (4, 6)]) == "at 1 s, 2 s and 4 to 6 s"
