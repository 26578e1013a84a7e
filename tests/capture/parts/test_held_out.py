"""Test and validation pictures are kept out, and records tell what trained."""

import inspect
from dataclasses import replace

import pytest

from ico3d.capture.capture import Capture, last_eleventh
from ico3d.capture.parts.held_out import scored_pictures, training_part
from ico3d.capture.parts.trained_on import (
    check_told,
    check_untrained,
    is_same_recording,
    trained_on,
)
from ico3d.errors import CaptureError
from support.avatars.planted_person import FRAMES, PlantedPerson
from support.heads.tiny_capture import TinyCapture


@pytest.fixture
def person(tmp_path):
    """Ten cameras, of which two test and one validates."""
    return PlantedPerson(tmp_path / "person")


@pytest.mark.parametrize(("hold_out", "hidden"), [(False, {3, 8}), (True, {0, 3, 8})])
def test_nothing_of_a_held_out_camera_is_seen(person, hold_out, hidden):
    """Neither picture nor mask nor landmarks; head poses are those of the capture."""
    part = training_part(person, hold_out)
    assert set(part.split.test_cameras) == hidden
    for camera in range(len(person.cameras)):
        sees = camera not in hidden
        assert part.has_image(camera, 2) == part.has_mask(camera, 2) == sees
        shown = (part.image(camera, 2), part.mask(camera, 2), part.head_mask(camera, 2))
        assert [layer is not None for layer in shown] == [sees] * 3
        assert (part.landmarks(camera, 2) is not None) == sees
    assert part.world_from_head(2) is not None and part.world_points(2) is not None


def test_whatever_tells_of_a_picture_is_hidden(person):
    """Each method of a capture that takes a camera and a frame, those to come included."""
    part = training_part(person, False)
    about = [
        name
        for name, method in vars(Capture).items()
        if callable(method) and {"camera", "frame"} <= inspect.signature(method).parameters.keys()
    ]
    assert {"image", "mask_bytes", "landmarks"} <= set(about)
    for name in about:
        assert getattr(part, name)(3, 2) in (None, False), name
        told = getattr(person, name)(2, 2) is not None
        assert (getattr(part, name)(2, 2) is not None) == told, name


def test_the_last_training_frames_of_a_head_are_for_validation(tmp_path):
    """A tenth of them; test frames are others."""
    capture = TinyCapture(tmp_path)
    assert capture.split.validation == (36, 37, 38, 39) and capture.split.test[0] == 40
    assert training_part(capture, False).split == capture.split
    part = training_part(capture, True)
    assert part.split.train == tuple(range(36))
    assert part.image(0, 34) is not None and part.image(0, 36) is None
    assert part.image(0, 40) is None
    assert scored_pictures(capture, "validation") == ((0, 1), (36, 37, 38, 39))
    assert scored_pictures(capture, "test") == ((0, 1), (40, 41, 42, 43))


def test_which_pictures_are_scored(person):
    """All frames by the cameras in question."""
    every = tuple(range(FRAMES))
    assert scored_pictures(person, "test") == ((3, 8), every)
    assert scored_pictures(person, "validation") == ((0,), every)
    assert scored_pictures(person, "all") == (tuple(range(10)), every)
    person.split = replace(person.split, test_cameras=(), validation_cameras=())
    for which, words in (("test", "no test cameras"), ("validation", "no validation pictures")):
        with pytest.raises(CaptureError, match=words):
            scored_pictures(person, which)
    with pytest.raises(CaptureError, match="no validation pictures"):
        training_part(person, True)


def test_what_trained_is_no_test(person, tmp_path):
    """A picture counts as trained where camera and frame did; another recording never does."""
    record = trained_on(person, [0, 2], [0, 1, 2, 4])
    assert record["cameras"] == ["c0", "c2"] and record["frames"] == [[0, 2], [4, 4]]
    check_untrained([record], person, [3, 8], range(FRAMES))
    check_untrained([record], person, [2], [3, 5])
    with pytest.raises(CaptureError, match=r"frame 4 by camera c2 trained this model"):
        check_untrained([{}, record], person, [1, 2], [3, 4])
    copied = PlantedPerson(tmp_path / "copied")
    with pytest.raises(CaptureError, match="trained this model"):
        check_untrained([record], copied, [2], [4])
    endless = record | {"frames": [[0, 10**15]]}  # of a stranger's model: nothing is counted out
    with pytest.raises(CaptureError, match=r"frame 3 by camera c2"):
        check_untrained([endless], person, [2], [4, 3])
    other = PlantedPerson.elsewhere(tmp_path / "other")
    assert is_same_recording(record, copied) and not is_same_recording(record, other)
    check_untrained([record], other, [2], [4])


RECORD = {"cameras": ["c0"], "frames": [[0, 2]]}


@pytest.mark.parametrize(
    "summary",
    [
        [],
        "text",
        {"recording": []},
        {"recoloured": 7},
        {"continued": {}},
        {"continued": ["text"]},
        {"recording": RECORD | {"frames": "ab"}},
        {"recording": RECORD | {"frames": [[0.5, 1]]}},
        {"recording": RECORD | {"frames": [[1]]}},
        {"recording": RECORD | {"frames": [[True, 1]]}},
        {"recording": RECORD | {"cameras": 5}},
        {"recording": RECORD | {"cameras": [[1]]}},
        {"recording": {"cameras": ["c0"]}},
    ],
    ids=str,
)
def test_records_that_make_no_sense(summary):
    check_told({"recording": RECORD, "recoloured": {}, "continued": [RECORD]})
    check_told({})
    with pytest.raises(ValueError, match=r"summary|record|continued"):
        check_told(summary)


def test_heads_are_split_by_frames():
    """One that is too short to validate says so by an empty tuple."""
    assert last_eleventh(8).validation == () and last_eleventh(22).validation == (18, 19)
