"""MediaPipe reads a recording: here one that shows nobody."""

import pytest

from ico3d.capture.posing.command import Pose
from ico3d.errors import CaptureError, MissingModelError
from support.needs import needs
from support.recordings import multiview_folders
from support.shared import MODELS

pytestmark = [needs("mediapipe"), needs("anny"), pytest.mark.slow]


@pytest.fixture
def clip(tmp_path):
    return multiview_folders.write_folder(tmp_path / "clip")


@pytest.mark.skipif(
    not (MODELS / "pose_landmarker.task").is_file(), reason="MediaPipe's body model is not here"
)
def test_where_nobody_is_seen_it_says_so_and_names_what_needs_no_skeleton(clip, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))
    with pytest.raises(CaptureError, match=r"none of 12 pictures shows a person.*swings\+\+"):
        Pose(clip, workers=1).run()
    assert not (clip / "body_track.safetensors").exists()


def test_missing_models_are_named_with_how_to_fetch_them(clip, monkeypatch, tmp_path):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(MissingModelError, match="ico3d weights fetch pose-landmarker"):
        Pose(clip, workers=1).run()
