"""The webcam's film of a synthetic recording, beside pictures that stay as they are."""

import json

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.video import open_video, read_sound
from ico3d.errors import SettingsError
from ico3d.studio.recording import record
from ico3d.studio.webcam.film import write_film
from support.recordings import synthetic_people

pytestmark = pytest.mark.slow


def _settings(subject, **changes):
    return synthetic_people.small_recording(subject, **{"cameras": 1, "frames": 6, **changes})


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return synthetic_people.write_person(tmp_path_factory.mktemp("people") / "block.npz")


@pytest.fixture(scope="module")
def clean(person, tmp_path_factory):
    out = tmp_path_factory.mktemp("captures") / "clean"
    record(_settings(person), out, workers=1)
    return open_capture(out)


def test_the_film_lies_beside_pictures_that_stay_clean(person, clean, tmp_path):
    record(_settings(person, faults=("exposure", "noise")), tmp_path / "faulty", workers=1)
    faulty = open_capture(tmp_path / "faulty")
    gains = np.array(json.loads((tmp_path / "faulty" / "webcam.json").read_text())["gains"])
    pictures = list(open_video(tmp_path / "faulty" / "webcam.mp4", 512).frames(25.0))
    sound = read_sound(tmp_path / "faulty" / "webcam.mp4")
    assert len(pictures) == len(gains) == 6
    assert sound is not None and len(sound.samples) >= 6 * 640
    for frame, picture in enumerate(pictures):
        assert (faulty.image_bytes(0, frame) == clean.image_bytes(0, frame)).all()
        brighter = picture.astype(float).mean() / clean.image_bytes(0, frame).mean()
        assert brighter == pytest.approx(gains[frame, 1] ** (1 / 2.4), abs=0.05)


def test_a_film_has_no_noise_but_its_own(clean, tmp_path):
    of = (lambda frame: clean.image_bytes(0, frame), 6, 25.0, None)
    write_film(tmp_path / "clean.mp4", *of, (), 0)
    write_film(tmp_path / "noisy.mp4", *of, ("noise",), 0)
    away = {
        name: _error(clean, list(open_video(tmp_path / f"{name}.mp4", 512).frames(25.0)))
        for name in ("clean", "noisy")
    }
    assert away["clean"] < 1.5 < 2.5 < away["noisy"]


def _error(clean, pictures) -> float:
    """Mean difference of the film's pictures and the clean ones, of 255."""
    return float(
        np.mean(
            [
                np.abs(picture.astype(float) - clean.image_bytes(0, frame)).mean()
                for frame, picture in enumerate(pictures)
            ]
        )
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"faults": ("dust",)}, "no fault 'dust': use noise or"),
        ({"faults": ("noise",), "cameras": 3}, "takes every frame"),
        ({"faults": ("noise",), "size": 41}, "must be even"),
    ],
)
def test_what_makes_no_film_is_refused(person, tmp_path, changes, words):
    with pytest.raises(SettingsError, match=words):
        record(_settings(person, **changes), tmp_path / "x", workers=1)
    assert not (tmp_path / "x").exists()
