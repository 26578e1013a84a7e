"""Captures with smaller pictures."""

import numpy as np
import pytest
import soundfile

from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.writing import new_folder
from ico3d.cli import main
from ico3d.errors import SettingsError
from ico3d.rig import body_track
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import from_rotvec
from ico3d.rig.rig import Rig
from support.recordings import multiview_folders


@pytest.fixture
def two_sizes(tmp_path):
    """Three cameras: two of 80 x 64 pixels, one of 30 x 20."""
    folder, rig = (
        tmp_path / "whole",
        [*multiview_folders.ring(2, (80, 64)), multiview_folders.ring(3, (30, 20))[2]],
    )
    for index, camera in enumerate(rig):
        size = (camera.width, camera.height)
        multiview_folders.save(
            folder / f"images/{camera.name}/000000.png", multiview_folders.picture(index, 0, size)
        )
        mask = np.zeros((size[1], size[0]), np.uint8)
        mask[size[1] // 4 :, size[0] // 4 : -size[0] // 4] = 255
        multiview_folders.save(folder / f"masks/{camera.name}/000000.png", mask)
        multiview_folders.save(
            folder / f"backgrounds/{camera.name}.png", multiview_folders.picture(index, 1, size)
        )
    (folder / "points").mkdir()
    np.save(folder / "points/000000.npy", np.ones((4, 3), np.float32))
    return multiview_folders.write_cameras(
        folder, [multiview_folders.entry(camera) for camera in rig], 1
    )


def test_pixels_are_means_of_what_they_cover(two_sizes):
    whole = open_capture(two_sizes)
    small = ResizedCapture(whole, 32)
    assert [(c.width, c.height) for c in small.cameras] == [(40, 32), (40, 32), (30, 20)]
    expected = multiview_folders.picture(0, 0, (80, 64)).reshape(32, 2, 40, 2, 3).mean((1, 3)) / 255
    np.testing.assert_allclose(small.image(0, 0), expected, atol=1e-6)
    assert small.mask(0, 0).sum() * 4 == pytest.approx(whole.mask(0, 0).sum())
    assert small.background(1).shape == (32, 40, 3)
    np.testing.assert_array_equal(small.image(2, 0), whole.image(2, 0))
    assert small.kind == "multiview" and small.split == whole.split and small.whole is whole


def test_cameras_see_points_where_the_pictures_show_them(two_sizes):
    whole = open_capture(two_sizes)
    small = ResizedCapture(whole, 32)
    points = np.random.default_rng(0).normal((0, 1, 0), 0.5, (9, 3))
    for before, after in zip(whole.cameras[:2], small.cameras[:2], strict=True):
        np.testing.assert_allclose(after.project(points)[0], before.project(points)[0] / 2)


def test_everything_else_is_that_of_the_capture(folder):
    """A portrait: poses, expressions, landmarks, sound."""
    whole = open_capture(folder)
    small = ResizedCapture(whole, 16)
    np.testing.assert_array_equal(small.landmarks(0, 3), whole.landmarks(0, 3) / 4)
    np.testing.assert_array_equal(small.eyes(3), whole.eyes(3))
    np.testing.assert_array_equal(small.world_from_head(3), whole.world_from_head(3))
    np.testing.assert_array_equal(small.head_points(), whole.head_points())
    np.testing.assert_array_equal(small.audio().samples, whole.audio().samples)
    assert small.head_mask(0, 3).shape == (16, 16)
    assert small.provenance == whole.provenance and small.blendshapes(3) is None


def test_no_height_is_refused(two_sizes):
    with pytest.raises(SettingsError):
        ResizedCapture(open_capture(two_sizes), 0)


def test_the_command_writes_a_smaller_capture(two_sizes, tmp_path, capsys):
    out = tmp_path / "small"
    assert main(["capture", "resize", str(two_sizes), str(out), "--height", "32"]) == 0
    small, expected = open_capture(out), ResizedCapture(open_capture(two_sizes), 32)
    assert small.split == expected.split and small.provenance == expected.provenance
    for index, camera in enumerate(expected.cameras):
        np.testing.assert_allclose(small.cameras[index].intrinsics, camera.intrinsics)
        np.testing.assert_allclose(
            small.cameras[index].world_to_camera, camera.world_to_camera, atol=1e-12
        )
        # JPEG of noise, the worst there is
        assert np.abs(small.image(index, 0) - expected.image(index, 0)).mean() < 0.02
        np.testing.assert_allclose(small.mask(index, 0), expected.mask(index, 0), atol=0.5 / 255)
        np.testing.assert_allclose(
            small.background(index), expected.background(index), atol=0.51 / 255
        )
    np.testing.assert_array_equal(small.world_points(0), expected.world_points(0))
    assert main(["capture", "resize", str(two_sizes), str(out)]) == 1
    assert "exists already" in capsys.readouterr().err


def _track(whole) -> BodyTrack:
    """Of somebody with two joints."""
    random, frames = np.random.default_rng(0), whole.num_frames
    return BodyTrack(
        rig=Rig(("root", "arm"), (-1, 0), np.array([[0, 1, 0], [0.2, 1, 0.0]])),
        fps=whole.fps,
        rotations=from_rotvec(random.normal(size=(frames, 2, 3))).astype(np.float32),
        roots=random.normal(size=(frames, 3)).astype(np.float32),
        fitted=np.ones(frames, bool),
        vertices=random.normal(size=(4, 3)).astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        binding=Binding.strongest(random.random((4, 2))),
        source="made for a test",
    )


def test_tracks_are_written_anew_and_what_is_none_is_refused(two_sizes, tmp_path, capsys):
    """A link in somebody's folder would hand on the file that it names, a hole fill the disk."""
    whole, track = open_capture(two_sizes), two_sizes / body_track.NAME
    own = _track(whole)
    (tmp_path / "elsewhere").write_bytes(own.to_bytes())
    track.symlink_to(tmp_path / "elsewhere")
    resize = ["capture", "resize", str(two_sizes), "--height", "32"]
    assert main([*resize[:3], str(tmp_path / "small"), *resize[3:]]) == 0
    copied = tmp_path / "small" / body_track.NAME
    assert not copied.is_symlink()
    np.testing.assert_array_equal(open_capture(copied.parent).body_track().roots, own.roots)
    (tmp_path / "elsewhere").write_text("SECRET")
    assert main([*resize[:3], str(tmp_path / "secret"), *resize[3:]]) == 1
    assert "is damaged" in capsys.readouterr().err and not (tmp_path / "secret").exists()
    track.unlink()
    with track.open("wb") as file:
        file.truncate(1 << 33)
    assert main([*resize[:3], str(tmp_path / "hole"), *resize[3:]]) == 1
    assert "has more than" in capsys.readouterr().err and not (tmp_path / "hole").exists()


def test_points_are_not_written_where_the_disk_is_nearly_full(
    two_sizes, tmp_path, monkeypatch, capsys
):
    """Links to one hole of halves become gigabytes of numbers."""
    usage = new_folder.shutil.disk_usage(tmp_path)
    full = usage._replace(free=new_folder.SPARE + 47)  # four points have 48 bytes
    monkeypatch.setattr(new_folder.shutil, "disk_usage", lambda _: full)
    out = tmp_path / "small"
    assert main(["capture", "resize", str(two_sizes), str(out), "--height", "32"]) == 1
    assert "GB left: make room" in capsys.readouterr().err and not out.exists()


def test_sound_is_not_written_where_the_disk_is_nearly_full(
    two_sizes, tmp_path, monkeypatch, capsys
):
    """Two hours of silence are 0.4 MB of FLAC and 230 MB of samples."""
    soundfile.write(two_sizes / "audio.wav", np.zeros(1600, np.float32), 16_000)
    usage = new_folder.shutil.disk_usage(tmp_path)
    for free, code in ((3199, 1), (3200, 0)):
        enough = usage._replace(free=new_folder.SPARE + free)
        monkeypatch.setattr(new_folder.shutil, "disk_usage", lambda _, enough=enough: enough)
        out = tmp_path / f"small{free}"
        assert main(["capture", "resize", str(two_sizes), str(out), "--height", "32"]) == code
        assert out.exists() == (code == 0)
    assert "GB left: make room" in capsys.readouterr().err
