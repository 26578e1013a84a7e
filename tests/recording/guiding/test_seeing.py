"""Pictures and parts, with a tracker's double, and without a tracker."""

import io
from contextlib import contextmanager
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

from ico3d.capture import decoding
from ico3d.capture.face.mediapipe_face import Face
from ico3d.capture.vetting import rehearsal
from ico3d.creating.looking import samples
from ico3d.errors import MissingModelError
from ico3d.recording.guiding import seeing
from ico3d.recording.guiding.seeing import Eye, short_of, turn_of
from ico3d.recording.refusals import Refused
from support.needs import needs
from support.recordings.films import write_heard
from support.studio_page.parts import part_file

pytestmark = [needs("av"), needs("cv2"), pytest.mark.slow]


class Tracker:
    """Finds a face in the middle that turns a little further with each picture."""

    def __init__(self, *_):
        self.seen = 0

    def __exit__(self, *_):
        pass

    def faces(self, picture):
        height, width = picture.shape[:2]
        x, y = np.meshgrid(np.linspace(0.3, 0.7, 22), np.linspace(0.2, 0.8, 22))
        angle = np.radians(10.0 * self.seen)
        self.seen += 1
        pose = np.eye(4)
        pose[:3, 2] = (np.sin(angle), 0, np.cos(angle))
        points = np.stack([x.ravel() * width, y.ravel() * height], 1)[:478]
        return [Face(points, np.zeros(52, np.float32), pose)]


def _lacking(name, purpose):
    raise MissingModelError(f"{purpose} needs the model file '{name}'.")


@pytest.fixture
def eye(monkeypatch):
    monkeypatch.setattr(seeing, "model_file", lambda *_: None)
    monkeypatch.setattr(seeing, "FaceReader", Tracker)
    return Eye()


@pytest.fixture
def blind(monkeypatch):
    monkeypatch.setattr(seeing, "model_file", _lacking)
    return Eye()


def _jpeg(level, size=(96, 72), noise=0.0):
    pixels = np.random.default_rng(0).normal(level, noise, (*size[::-1], 3)).clip(0, 255)
    out = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(out, "JPEG")
    return out.getvalue()


def test_a_face_is_guided_by_the_tracker(eye):
    assert eye.lacking == ""
    told = eye.told(_jpeg(120, noise=40.0), "left")
    assert (told.word, told.turned["left"]) == ("left", 0.0)
    assert eye.told(_jpeg(30), None).word == "light"


def test_without_the_model_light_guides_and_it_is_said(blind):
    assert "face_landmarker.task" in blind.lacking
    assert blind.told(_jpeg(30), "left").word == "light"
    assert blind.told(_jpeg(120), None).word == "still"
    assert blind.told(_jpeg(120, noise=40.0), None).word == "good"


@pytest.mark.parametrize("data", [b"no picture", b"\x89PNG\r\n", _jpeg(9, (20, 20))])
def test_what_is_no_picture_is_refused(eye, data):
    with pytest.raises(Refused) as refused:
        eye.told(data, None)
    assert refused.value.code == "picture"


def test_a_part_is_reported_with_its_turns(eye, tmp_path):
    report = eye.report(part_file(tmp_path / "left.mp4", 50), "left")
    assert report["seconds"] == pytest.approx(1.96)
    assert report["turn"] == [0.0, 60.0, 0.0, 0.0]
    codes = [one["code"] for one in report["advice"]]
    assert "blur" in codes and not {"length-few", "length-short", "lips-still"} & set(codes)


def test_pictures_that_would_fill_the_memory_are_not_decoded(eye, tmp_path, monkeypatch):
    file = part_file(tmp_path / "left.mp4")
    monkeypatch.setattr(decoding, "MOST_PIXELS", 64 * 64 - 1)
    for id in ("left", "upload", "consent"):
        with pytest.raises(Refused, match="larger than is taken"):
            eye.report(file, id)


def test_a_turn_that_is_too_small_is_told(eye, tmp_path):
    report = eye.report(part_file(tmp_path / "right.mp4"), "right")
    assert report["advice"][-1] == {
        "code": "short-right",
        "level": "better",
        "values": {"n": 0, "goal": 20},
        "spans": [],
        "detail": "",
    }
    assert short_of("left", [0.0, 25.0, 0.0, 0.0]) == short_of("text-1", [0.0] * 4) == []
    (short,) = short_of("down", [0.0, 0.0, -4.5, 9.0])
    assert str(short) == "turn the head further down: it was turned by 4°, and 9° are enough."


@pytest.mark.parametrize(
    ("faces", "sound", "codes"),
    [(0, True, ["face-none"]), (2, True, ["faces"]), (1, False, ["sound-none"]), (1, True, [])],
)
def test_a_whole_video_is_refused_as_create_would(eye, tmp_path, monkeypatch, faces, sound, codes):
    class Several(Tracker):
        def faces(self, picture):
            return super().faces(picture) * faces

    @contextmanager
    def readers():
        yield Several(), None

    monkeypatch.setattr(samples, "_readers", readers)
    file = part_file(tmp_path / "mine.mp4", 100, sound=sound)
    if codes:
        with pytest.raises(Refused) as refused:
            eye.report(file, "upload")
        assert (refused.value.code, refused.value.status) == ("unusable", 422)
        assert [one.code for one in refused.value.advice] == codes
        assert str(refused.value) == " ".join(str(one) for one in refused.value.advice)
    else:
        report = eye.report(file, "upload")
        assert report["seconds"] == pytest.approx(3.96) and report["turn"] is None
        assert "length-few" in [one["code"] for one in report["advice"]]


def test_without_the_model_a_video_without_sound_is_refused_all_the_same(blind, tmp_path):
    with pytest.raises(Refused, match="the video has no sound"):
        blind.report(part_file(tmp_path / "mute.mp4", sound=False), "upload")
    assert blind.report(part_file(tmp_path / "heard.mp4"), "upload")["seconds"] == 0.96


def test_without_the_model_a_part_is_still_kept(blind, tmp_path):
    report = blind.report(part_file(tmp_path / "left.mp4"), "left")
    assert (report["seconds"], report["turn"]) == (0.96, None)


def test_consent_must_be_heard_and_may_be_without_pictures(eye, tmp_path):
    assert eye.report(part_file(tmp_path / "said.mp4"), "consent")["seconds"] == pytest.approx(
        1.0, abs=0.1
    )
    with pytest.raises(Refused, match="nothing is heard"):
        eye.report(part_file(tmp_path / "silent.mp4", sound=False), "consent")
    said = np.random.default_rng(0).integers(-9000, 9000, 16_000, np.int16)
    heard = write_heard(tmp_path / "heard.mkv", said, 16_000, pictures=False)
    assert eye.report(heard, "consent")["seconds"] == 1.0


@pytest.mark.parametrize("id", ["upload", "text-1", "consent"])
def test_a_file_that_is_no_video_is_one_sentence(eye, tmp_path, id):
    file = tmp_path / "x.part"
    file.write_bytes(b"\x1a\x45\xdf\xa3" + bytes(500))
    with pytest.raises(Refused) as refused:
        eye.report(file, id)
    assert refused.value.code == "no-video"


def test_tables_that_promise_too_much_are_no_large_picture(eye, tmp_path):
    file = part_file(tmp_path / "x.mp4")
    data = file.read_bytes()
    at = data.index(b"stsz") + 12
    file.write_bytes(data[:at] + b"\3\0\0\0" + data[at + 4 :])
    with pytest.raises(Refused) as refused:
        eye.report(file, "upload")
    assert refused.value.code == "no-video"


@pytest.mark.parametrize("id", ["upload", "text-1", "consent"])
def test_a_film_that_takes_too_much_to_be_opened_is_told(eye, tmp_path, monkeypatch, id):
    """The process that opens it first is killed."""
    monkeypatch.setattr(rehearsal.subprocess, "run", lambda *_, **__: Mock(returncode=-9))
    with pytest.raises(Refused, match="more time or memory") as refused:
        eye.report(part_file(tmp_path / "x.mp4"), id)
    assert (refused.value.code, refused.value.status) == ("costly", 422)


def test_turns_by_name():
    assert [turn_of(text) for text in ("left", "down", "text-1", "")] == [
        "left",
        "down",
        None,
        None,
    ]


def test_a_picture_of_thousands_of_passes_is_not_decoded(eye):
    written = io.BytesIO()
    Image.new("RGB", (640, 480)).save(written, "JPEG", progressive=True)
    whole = written.getvalue()
    last = whole[whole.rfind(b"\xff\xda") : -2]
    assert eye.told(whole, None) is not None
    with pytest.raises(Refused, match="unusual form"):
        eye.told(whole[:-2] + last * 1000 + whole[-2:], None)
