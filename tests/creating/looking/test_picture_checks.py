"""What is said of pictures: nothing about good ones, each fault with its seconds."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.creating.looking.picture_checks import picture_advice
from ico3d.creating.looking.samples import Sample, Samples

APART, COUNT = 0.25, 80


def _good(number: int) -> Sample:
    """A lively, well-lit face."""
    turn = (20 * np.sin(number / 7), 9 * np.sin(number / 5))
    jaw = 0.15 + 0.15 * np.sin(number)
    return Sample(
        APART * number, 1, 0.5, 0.0, 0.3, 240, True, False, turn, jaw, np.full((2, 8, 8), 0.6)
    )


def _advice(changed: range = range(0), sought: bool = True, **change):
    """What is said of a good video, some of whose pictures are different."""
    every = [_good(i) for i in range(COUNT)]
    every = [replace(s, **change) if i in changed else s for i, s in enumerate(every)]
    return list(picture_advice(Samples(tuple(every), APART, 512, sought)))


def test_a_good_video_needs_nothing():
    assert _advice() == []


SOME = range(40, 49)
"""Pictures of 10 to 12 s."""


@pytest.mark.parametrize(
    ("topic", "change", "words"),
    [
        ("frame", {"inside": False}, "cut off by the edge"),
        ("hands", {"hands": True}, "hand is before the face"),
        ("light", {"light": 0.2}, "the face is dark"),
        ("light", {"burnt": 0.2}, "parts of the face are white"),
        ("exposure", {"light": 0.6}, "brightness changes"),
        ("blur", {"sharpness": 0.05}, "blurred"),
        ("camera", {"corners": np.full((2, 8, 8), 0.9)}, "camera or the background moves"),
        ("face", {"faces": 0}, "no face is seen"),
    ],
)
def test_a_fault_is_told_with_its_seconds(topic, change, words):
    found = [one for one in _advice(SOME, **change) if words in one.text]
    assert [(one.topic, one.level, one.spans) for one in found] == [
        (topic, "better", ((10.0, 12.0),))
    ]


def test_a_fault_all_along_has_no_seconds():
    (found,) = [one for one in _advice(range(COUNT), sharpness=0.05) if one.topic == "blur"]
    assert found.spans == ()


def test_a_second_face_is_an_accident_or_a_reason_to_refuse():
    assert [(a.topic, a.level) for a in _advice(range(3, 6), faces=2)] == [("faces", "better")]
    assert [(a.topic, a.level) for a in _advice(range(3, 40), faces=2)] == [("faces", "refused")]


def test_no_face_is_refused_and_darkness_is_told():
    (found,) = _advice(range(COUNT), faces=0, light=0.5)
    assert found.level == "refused" and "dark" not in found.text
    (found,) = _advice(range(COUNT), faces=0, light=0.05)
    assert found.level == "refused" and "turn on the light" in found.text


def test_a_room_too_dark_is_refused():
    refused = [a.topic for a in _advice(range(COUNT), light=0.03) if a.level == "refused"]
    assert refused == ["light"]


def test_a_filmed_photograph_is_refused():
    (found,) = _advice(range(COUNT), turn=(3.0, 1.0), jaw=0.05)
    assert found.level == "refused" and "as in a photograph" in found.text


def test_a_head_that_keeps_still_and_says_nothing_is_told():
    said = [one.text for one in _advice(range(1, COUNT), turn=(3.0, 1.0), jaw=0.2)]
    assert sum("turns" in text for text in said) == 2
    (only,) = [one.text for one in _advice(range(COUNT), jaw=0.01)]
    assert "lips hardly move" in only


def test_a_small_face_should_come_closer():
    (found,) = _advice(range(COUNT), width=100)
    assert found.topic == "distance" and "20 %" in found.text
