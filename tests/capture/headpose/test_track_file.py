"""The file beside a recording, and what a multiview capture gives from it."""

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load, save

from ico3d.capture.checking.check import examine
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.formats import open_capture
from ico3d.capture.headpose import track_file
from ico3d.capture.headpose.track_file import NAME, HeadTrack, read_track
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.importing.resizing import resize_capture
from ico3d.errors import CaptureError
from support.recordings import multiview_folders
from support.strangers.claimed import write_claim, write_crowded


@pytest.fixture
def folder(tmp_path):
    """Five cameras, three frames."""
    return multiview_folders.write_folder(tmp_path / "recording")


def _track(frames=3, cameras=5):
    random = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, 3] = random.normal((0, 1, 0), 0.1, (frames, 3))
    views = np.ones((frames, cameras), np.uint8)
    views[1] = 0
    return HeadTrack(
        poses,
        random.normal(0, 0.05, (frames, 68, 3)).astype(np.float32),
        random.uniform(0, 1, (frames, 7)).astype(np.float32),
        random.uniform(0, 1, (frames, 52)).astype(np.float32),
        views,
    )


def test_a_capture_gives_what_was_tracked(folder):
    before = open_capture(folder)
    assert before.world_from_head(0) is None and before.blendshape_names is None
    assert before.landmarks(0, 0) is None and before.landmarks_3d(0) is None
    track = _track()
    assert track.write(folder) == folder / NAME
    capture = open_capture(folder)
    assert capture.blendshape_names == BLENDSHAPES
    for frame in range(3):
        np.testing.assert_array_equal(capture.world_from_head(frame), track.world_from_head[frame])
        np.testing.assert_array_equal(capture.eyes(frame), track.eyes[frame])
        np.testing.assert_array_equal(capture.blendshapes(frame), track.blendshapes[frame])
        np.testing.assert_array_equal(capture.landmarks_3d(frame), track.landmarks[frame])
    world = track.landmarks[2] + track.world_from_head[2, :3, 3]  # these heads do not turn
    np.testing.assert_allclose(capture.landmarks(4, 2), capture.cameras[4].project(world)[0])
    small = ResizedCapture(capture, 16)
    np.testing.assert_array_equal(small.landmarks_3d(1), track.landmarks[1])
    with pytest.raises(CaptureError, match="frames 0 to 2, not 3"):
        capture.world_from_head(3)


def test_smaller_pictures_keep_the_track(folder, tmp_path):
    track = _track()
    track.write(folder)
    resize_capture(folder, tmp_path / "small", 16, 1)
    small = open_capture(tmp_path / "small")
    np.testing.assert_array_equal(small.world_from_head(2), track.world_from_head[2])
    np.testing.assert_allclose(small.landmarks(4, 2), open_capture(folder).landmarks(4, 2) / 2)


def test_interpolated_frames_are_told(folder):
    track = _track()
    assert track.tracked.tolist() == [True, False, True] and track.gaps == [(1, 1)]
    ends = replace(track, views=np.array([[0, 0], [1, 0], [0, 0]], np.uint8))
    assert ends.gaps == [(0, 0), (2, 2)]
    track.write(folder)
    (head,) = [f for f in examine(open_capture(folder)) if f.what == "head"]
    assert head.level == "warn" and head.text.startswith("interpolated in 1 of 3 frames")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eyes": np.zeros((4, 7), np.float32)}, r"'eyes' must be \(3, 7\), found \(4, 7\)"),
        ({"views": None}, "'views' must be .* found nothing"),
        ({"landmarks": np.full((3, 68, 3), np.nan, np.float32)}, "'landmarks' holds NaN"),
        ({"landmarks": np.full((3, 68, 3), 1j, np.complex64)}, "'landmarks' holds no real"),
    ],
)
def test_a_track_of_another_recording_is_refused(folder, change, message):
    file = _track().write(folder)
    arrays = {**load(file.read_bytes()), **change}
    file.write_bytes(save({name: array for name, array in arrays.items() if array is not None}))
    with pytest.raises(CaptureError, match=message):
        open_capture(folder)


def test_a_damaged_track_is_one_sentence(folder):
    file = _track().write(folder)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(CaptureError, match="is damaged: delete it and run ico3d capture track"):
        open_capture(folder)


def test_a_track_that_claims_more_than_its_frames_take_is_not_read(folder, monkeypatch):
    write_claim(folder / NAME, "views", 1 << 28)
    monkeypatch.setattr(track_file, "load_bounded", pytest.fail)
    with pytest.raises(CaptureError, match="is damaged: delete it"):
        read_track(folder, 3, 5)


def test_a_track_of_thousands_of_tensors_is_not_read(folder):
    write_crowded(folder / NAME)
    with pytest.raises(CaptureError, match="is damaged: delete it"):
        read_track(folder, 3, 5)
