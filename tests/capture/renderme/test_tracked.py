"""A recording in SMC files keeps the head that was tracked in it, beside its files."""

from dataclasses import fields

import numpy as np
import pytest

from ico3d.capture.capture import Capture
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.formats import open_capture
from ico3d.capture.headpose.track_file import HeadTrack, check_writable
from ico3d.capture.headtrack import tracker
from ico3d.capture.importing.resizing import resize_capture
from ico3d.cli import main
from ico3d.errors import CaptureError
from support.recordings import renderme_files


@pytest.fixture
def plain(tmp_path):
    return renderme_files.write_recording(tmp_path / "recording")


def track_of(capture: Capture) -> HeadTrack:
    """A head that nobody else knows."""
    random, count = np.random.default_rng(0), capture.num_frames
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = random.normal(0, 0.1, (count, 3))
    return HeadTrack(
        poses,
        random.normal(0, 0.05, (count, 68, 3)).astype(np.float32),
        random.random((count, 7)).astype(np.float32),
        random.random((count, len(BLENDSHAPES))).astype(np.float32),
        np.ones((count, len(capture.cameras)), np.uint8),
    )


def test_the_command_takes_the_recording_as_it_is(plain, monkeypatch, capsys):
    """Named by its folder; the track lies beside the file, and is found by either name."""
    own = open_capture(plain)
    track = track_of(own)
    report = tracker.Report(own.num_frames, own.num_frames, 0.5, 3.0, [])
    monkeypatch.setattr(tracker, "track_head", lambda source, workers: (track, report))
    assert main(["capture", "track", str(plain.parent)]) == 0
    file = plain.with_name("0026_e0_raw.tracking.safetensors")
    assert file.is_file() and file.name in "".join(capsys.readouterr().err.split())
    for path in (plain, plain.parent):
        found = open_capture(path)
        assert (found.kind, found.path) == ("renderme-360", plain)
        assert (found.split, found.blendshape_names) == (own.split, BLENDSHAPES)
        for frame in range(own.num_frames):
            np.testing.assert_array_equal(
                found.world_from_head(frame), track.world_from_head[frame]
            )
            np.testing.assert_array_equal(found.landmarks_3d(frame), track.landmarks[frame])
            np.testing.assert_array_equal(found.eyes(frame), track.eyes[frame])
            np.testing.assert_array_equal(found.image(3, frame), own.image(3, frame))
            np.testing.assert_array_equal(found.mask(3, frame), own.mask(3, frame))


def test_its_surface_moves_to_the_tracks_head_space(plain):
    """Where it is in the world, it stays."""
    own = open_capture(plain)
    track_of(own).write(own.path)
    found = open_capture(plain)

    def placed(capture):
        pose = capture.world_from_head(1)
        return capture.head_points(1) @ pose[:3, :3].T + pose[:3, 3]

    np.testing.assert_allclose(placed(found), placed(own), atol=1e-9)
    pixels = found.cameras[2].project(
        track_of(own).landmarks[1] + track_of(own).world_from_head[1][:3, 3]
    )[0]
    np.testing.assert_allclose(found.landmarks(2, 1), pixels)
    assert "tracked in all 4 frames" in found.inspect()[-1].text
    with pytest.raises(CaptureError, match="frames 0 to 3, not 4"):
        found.eyes(4)


def test_smaller_copies_keep_it(plain, tmp_path):
    """It is in metres."""
    own = open_capture(plain)
    track = track_of(own)
    track.write(own.path)
    resize_capture(plain, tmp_path / "small", 20, 1)
    small = open_capture(tmp_path / "small")
    np.testing.assert_array_equal(small.world_from_head(2), track.world_from_head[2])


def test_a_track_of_another_recording_is_refused(plain):
    """In one sentence."""
    own = open_capture(plain)
    track = track_of(own)
    short = HeadTrack(**{f.name: getattr(track, f.name)[:2] for f in fields(track)})
    short.write(own.path)
    with pytest.raises(CaptureError, match=r"must be .*run ico3d capture track again"):
        open_capture(plain)


def test_where_nothing_can_be_written(plain):
    """A copy is offered."""
    own = open_capture(plain)
    with pytest.raises(CaptureError, match=r"cannot be written .*with ico3d capture resize"):
        track_of(own).write(plain / "deeper" / "0026.smc")
    with pytest.raises(CaptureError, match=r"cannot be written .*with ico3d capture resize"):
        check_writable(plain / "deeper" / "0026.smc")  # before anything is tracked
    check_writable(own.path)
