"""The whole way from a video to a capture, where MediaPipe and its model are there."""

import json
from pathlib import Path

import numpy as np
import pytest

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.capture.portrait import settings as portrait_settings
from ico3d.capture.portrait.settings import PortraitSettings
from ico3d.capture.portrait.track import track_portrait
from ico3d.cli import main
from ico3d.errors import CaptureError
from support.needs import needs
from support.shared import MODELS, SHARED

CLIP = SHARED / "clips" / "portrait_a.mp4"

av = pytest.importorskip("av")
pytestmark = [pytest.mark.slow, needs("mediapipe")]
needs_clip = pytest.mark.skipif(not CLIP.is_file(), reason="../shared/clips is not here")


@pytest.fixture(autouse=True)
def model(monkeypatch):
    if not (MODELS / "face_landmarker.task").is_file():
        pytest.skip("face_landmarker.task is not here")
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))
    monkeypatch.setattr(portrait_settings, "STEPS", (30, 30))  # its own test tells whether it helps


def _faceless(path: Path, frames: int = 6) -> Path:
    """A video of coloured noise."""
    random = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 128, 128, "yuv420p"
        for _ in range(frames):
            picture = random.integers(0, 255, (128, 128, 3), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return path


SIZE = 192
"""Of the pictures, which the clip's are made smaller to."""


def _shortened(path: Path, frames: int, blank: range = range(0)) -> Path:
    """The first frames of the clip without sound, those in `blank` covered."""
    with av.open(str(CLIP)) as source, av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"crf": "10"})
        stream.width, stream.height, stream.pix_fmt = SIZE, SIZE, "yuv420p"
        for number, frame in enumerate(source.decode(video=0)):
            if number == frames:
                break
            picture = frame.reformat(SIZE, SIZE, format="rgb24").to_ndarray()
            if number in blank:
                picture[:] = 90
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return path


def _capture(video: Path, out: Path, *options: str) -> int:
    return main(["capture", "portrait", str(video), str(out), *options])


def test_video_without_a_face(tmp_path, capfd):
    assert _capture(_faceless(tmp_path / "noise.mp4"), tmp_path / "out") == 1
    message = capfd.readouterr().err
    assert (
        "noise.mp4: no face is found in any of the 6 pictures" in message
        and "Traceback" not in message
    )
    assert sorted(p.name for p in tmp_path.iterdir()) == ["noise.mp4"]
    with pytest.raises(CaptureError) as told:
        track_portrait(tmp_path / "noise.mp4", tmp_path / "out", PortraitSettings())
    assert (told.value.code, told.value.values) == ("faceless", {"n": 6})


def test_existing_folder_is_left_alone(tmp_path, capfd):
    (tmp_path / "out").mkdir()
    assert _capture(_faceless(tmp_path / "noise.mp4"), tmp_path / "out") == 1
    assert "exists already" in capfd.readouterr().err


AGREED = ("--likeness", "Ada", "--consent", "tests")


@needs_clip
def test_frames_without_a_face_and_without_sound(tmp_path, capfd):
    video = _shortened(tmp_path / "v.mp4", 22, blank=range(11, 14))
    assert _capture(video, tmp_path / "out", *AGREED, "--intrinsics", "600") == 0
    said = " ".join(capfd.readouterr().err.split())
    assert "3 of 22 frames show no face and are left out (frames 11, 12, 13)" in said
    assert "no sound" in said
    capture = open_capture(tmp_path / "out")
    assert capture.num_frames == 22 and capture.audio() is None
    details = json.loads((tmp_path / "out" / "ico3d.json").read_text())
    repeated = details["frames_repeated"]
    assert {5, 10, 19} <= set(repeated) <= {5, 10, 19, 21}  # the clip came from 24 per second
    shown = [f for f in range(22) if f not in (11, 12, 13, *repeated)]
    assert [f for f in range(22) if capture.image(0, f) is not None] == shown
    assert capture.split.train + capture.split.test == tuple(shown)
    assert capture.cameras[0].intrinsics[0, 0] == 600.0
    assert np.isfinite(capture.blendshapes(12)).all()
    assert (capture.provenance["likeness"], capture.provenance["consent"]) == ("Ada", "tests")
    assert details["frames_without_face"] == [11, 12, 13]
    assert details["tracker"]["reprojection_px"] < 2
    assert {f.what: f.level for f in examine(capture) if f.level == "error"} == {}


@needs_clip
def test_truncated_video(tmp_path, capfd):
    whole = _shortened(tmp_path / "v.mkv", 16)
    data = whole.read_bytes()
    whole.write_bytes(data[: len(data) * 2 // 3])
    assert _capture(whole, tmp_path / "out") == 0
    assert 4 < open_capture(tmp_path / "out").num_frames < 16
