"""What ends a making is told by a code and numbers, which the page says in its languages."""

import fcntl
import json
import os
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from support.needs import needs

pytestmark = [pytest.mark.slow, needs("av"), needs("torch")]

from ico3d.creating.plan import check_room  # noqa: E402
from ico3d.creating.settings import QUALITIES  # noqa: E402
from ico3d.errors import StorageError  # noqa: E402
from ico3d.failures import FAILURES  # noqa: E402
from ico3d.recording.keeping.people import People  # noqa: E402
from ico3d.recording.making import makers, worker  # noqa: E402
from ico3d.recording.making.places import Places  # noqa: E402
from ico3d.recording.making.progress import read_progress  # noqa: E402
from support.full_disk import files_of_at_most  # noqa: E402
from support.shared import MODELS  # noqa: E402
from support.studio_page.parts import begun, kept, part_file  # noqa: E402

WORDS = Path(__file__).parents[3] / "viewer" / "src" / "words" / "studio.json"


@pytest.fixture
def person(tmp_path, monkeypatch):
    """Somebody who has agreed aloud, on a machine without models."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    ida = begun(tmp_path / "recordings")
    kept(ida, "consent", part_file(tmp_path / "consent.mp4", 5).read_bytes())
    return ida


@pytest.fixture
def video(tmp_path):
    return part_file(tmp_path / "video.mp4", 10)


def _failed(person):
    """What the page is told of a making that fails."""
    with pytest.raises(Exception):  # noqa: B017 - which one it is, is told by the progress
        worker.make(person, "quick")
    found = read_progress(Places(person.folder).folder)
    assert found is not None and found.state == "failed"
    return found


def _brought(person, data):
    kept(person, "upload", data)
    return _failed(person)


def _sound_alone(path):
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=16_000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 16_000), np.float32), "fltp", "mono")
        frame.sample_rate = 16_000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _webm(path, *milliseconds):
    """Black pictures at these moments."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libvpx", rate=25)
        stream.width = stream.height = 16
        for moment in milliseconds:
            frame = av.VideoFrame.from_ndarray(np.zeros((16, 16, 3), np.uint8), "rgb24")
            frame.pts, frame.time_base = moment, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path.read_bytes()


def test_a_file_that_is_cut_off(person, video):
    data = video.read_bytes()
    found = _brought(person, data[: len(data) // 3])  # an MP4's index is at its end
    assert found.code == "decoding" and found.error.startswith("the file cannot be decoded")


def test_a_file_of_an_unknown_kind(person, video):
    assert _brought(person, video.read_bytes().replace(b"avc1", b"what")).code == "kind"


def test_a_file_without_pictures(person, tmp_path):
    data = _webm(tmp_path / "a.webm", 0, 40)
    first = data.index(b"\x1f\x43\xb6\x75") + 4  # the first of its clusters of pictures
    assert _brought(person, data[:first]).code == "no-picture"
    assert _brought(person, _sound_alone(tmp_path / "a.mp4").read_bytes()).code == "streamless"


def test_a_picture_that_is_called_a_video(person, video):
    from PIL import Image

    kept(person, "upload", video.read_bytes())
    Image.new("RGB", (64, 64)).save(person.folder / "parts" / "upload.mp4", "PNG")
    assert _failed(person).code == "photograph"


def test_a_part_that_does_not_end(person, tmp_path):
    kept(person, "text-1", _webm(tmp_path / "long.webm", 0, 10**10))
    found = _failed(person)
    assert (found.code, found.values) == ("long", {"n": 7200})


def test_parts_of_two_shapes(person, video, tmp_path):
    kept(person, "text-1", video.read_bytes())
    kept(person, "left", part_file(tmp_path / "wide.mp4", 10, size=(128, 64)).read_bytes())
    found = _failed(person)
    assert found.code == "shape"
    assert found.values == {"part": "left.mp4", "first": "text-1.mp4"}


def test_nothing_is_recorded_or_the_file_is_gone(person, tmp_path):
    assert _failed(person).code == "nothing"
    from ico3d.capture.video import open_video

    with pytest.raises(Exception, match="there is no video file") as told:
        open_video(tmp_path / "none.mp4", 64)
    assert told.value.code == "gone"


def test_a_machine_without_the_face_model(person, video):
    found = _brought(person, video.read_bytes())
    assert (found.code, found.values) == ("model", {"file": "face_landmarker.task"})


def test_another_process_makes_it(person, video):
    kept(person, "upload", video.read_bytes())
    _failed(person)
    with (Places(person.folder).work / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert _failed(person).code == "busy"


def test_a_disk_that_is_full_or_too_small(person, video, tmp_path):
    kept(person, "text-1", video.read_bytes())
    with files_of_at_most(1500):  # the progress, not the parts as one video
        assert _failed(person).code == "disk-full"
    with pytest.raises(StorageError, match=r"has .* GB left and 3506176\.4 GB are") as told:
        check_room(tmp_path, QUALITIES["quick"], 1e9, 512**2)
    assert told.value.code == "disk-room" and told.value.values["needed"] == 3506176.4


def test_a_disk_on_which_not_even_that_can_be_noted(person, video, monkeypatch, tmp_path):
    kept(person, "upload", video.read_bytes())
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    begin = makers.start

    def start(*words):
        with files_of_at_most(10):  # which the process inherits
            return begin(*words)

    monkeypatch.setattr(makers, "start", start)
    made = makers.Makers(People(tmp_path / "recordings"))
    try:
        made.begin(person, "quick")
        made._running["Ida"].wait()
        found = made.progress(person)
        assert found is not None
        assert (found.state, found.code) == ("failed", "disk-full")
    finally:
        made.close()


def test_memory_that_runs_out(person, video, monkeypatch):
    monkeypatch.setattr(worker, "create", lambda settings, tell: np.ones(1 << 50))
    found = _brought(person, video.read_bytes())
    assert (found.code, found.error) == ("memory", FAILURES["memory"])


def test_what_nobody_foresaw_has_no_code_and_its_own_words(person, video, monkeypatch):
    monkeypatch.setattr(worker, "create", lambda settings, tell: 1 // 0)
    found = _brought(person, video.read_bytes())
    assert (found.code, found.values) == ("", {})
    assert found.error == "ZeroDivisionError: integer division or modulo by zero"


@needs("mediapipe")
@pytest.mark.skipif(not (MODELS / "face_landmarker.task").is_file(), reason="no face model is here")
@pytest.mark.parametrize(("level", "code"), [(120, "face-none"), (3, "face-dark")])
def test_a_video_without_a_face_and_without_light(person, tmp_path, monkeypatch, level, code):
    """What looking at a video refuses is told as advice, and needs no code of its own."""
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))
    found = _brought(person, part_file(tmp_path / "seen.mp4", 100, level).read_bytes())
    assert [one["code"] for one in found.refused] == [code] and found.code == ""


@pytest.mark.parametrize("code", FAILURES)
def test_the_page_says_every_failure_in_its_languages(code):
    """In English as a terminal; that no language lacks a value is tested with the page's words."""
    words = json.loads(WORDS.read_text("utf-8"))
    said, languages = words[f"studio.failure.{code}"], words["studio.title"].keys()
    assert said.keys() == languages and len(set(said.values())) == len(languages) == 6
    assert said["en"] == FAILURES[code][0].upper() + FAILURES[code][1:]


def test_the_page_says_no_failure_that_never_happens():
    words = json.loads(WORDS.read_text("utf-8"))
    there = {key.removeprefix("studio.failure.") for key in words if ".failure." in key}
    assert there == FAILURES.keys()
