"""One instruction at a time: the most urgent one."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.creating.looking.samples import Sample
from ico3d.recording.guiding.guide import Told, instruct, without_faces

GOOD = Sample(0.0, 1, 0.5, 0.0, 0.3, 200, True, False, (0.0, 0.0), 0.2, np.zeros((2, 8, 8)))
NOT_TURNED = {"left": 0.0, "right": 0.0, "up": 0.0, "down": 0.0}


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({}, "good"),
        ({"faces": 0}, "face"),
        ({"faces": 0, "light": 0.1}, "light"),
        ({"faces": 2, "light": 0.1}, "faces"),
        ({"light": 0.2, "width": 60}, "light"),
        ({"light": 0.9}, "bright"),
        ({"burnt": 0.3}, "bright"),
        ({"width": 400, "inside": False}, "further"),
        ({"inside": False, "width": 60}, "frame"),
        ({"width": 60, "sharpness": 0.01}, "closer"),
        ({"sharpness": 0.05}, "still"),
        ({"turn": (14.0, 0.0)}, "ahead"),
    ],
)
def test_the_most_urgent_fault_is_told(change, word):
    assert instruct(replace(GOOD, **change), 480, None).word == word


def test_a_turn_is_told_until_it_is_reached():
    assert instruct(GOOD, 480, "left") == Told("left", NOT_TURNED)
    half = instruct(replace(GOOD, turn=(10.0, 4.5)), 480, "left")
    assert half == Told("left", NOT_TURNED | {"left": 0.5, "up": 0.5})
    assert instruct(replace(GOOD, turn=(25.0, 0.0)), 480, "left").word == "good"
    assert instruct(replace(GOOD, turn=(25.0, 0.0)), 480, "right").word == "right"
    assert instruct(replace(GOOD, turn=(0.0, -9.0)), 480, "down").word == "good"
    assert instruct(replace(GOOD, faces=0), 480, "left").turned is None


@pytest.mark.parametrize(
    ("light", "sharpness", "word"),
    [(0.1, 0.3, "light"), (0.9, 0.3, "bright"), (0.5, 0.05, "still"), (0.5, None, "good")],
)
def test_without_a_tracker_light_and_blur_are_told(light, sharpness, word):
    assert without_faces(light, sharpness) == Told(word, None)
