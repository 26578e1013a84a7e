"""Masks from clean plates, against the truth of a drawn scene."""

import logging
from functools import partial

import cv2
import numpy as np
import pytest

from ico3d.capture.formats import open_capture, opened_apart
from ico3d.capture.multiview import reader
from ico3d.capture.multiview.cutout import matte
from ico3d.capture.multiview.description import read_description
from ico3d.capture.multiview.masks import make_masks
from ico3d.cli import main
from ico3d.errors import CaptureError
from support.recordings import multiview_folders

pytestmark = pytest.mark.slow

SIZE = (240, 360)
"""Width, height."""


def plate_and_person(seed: int):
    """A textured wall, a person who akimbo leaves a hole at the arm, and the truth (H, W)."""
    random = np.random.default_rng(seed)
    shape = (SIZE[1], SIZE[0])
    wall = 150 + cv2.GaussianBlur(random.normal(0, 60, (*shape, 3)), (0, 0), 3)
    truth = np.zeros(shape, np.float32)
    cv2.ellipse(truth, (120, 70), (26, 34), 0, 0, 360, 1.0, -1, cv2.LINE_AA)
    cv2.ellipse(truth, (120, 200), (46, 110), 0, 0, 360, 1.0, -1, cv2.LINE_AA)
    cv2.polylines(truth, [np.array([(85, 130), (45, 190), (90, 240)])], False, 1.0, 14, cv2.LINE_AA)
    y, x = np.mgrid[: shape[0], : shape[1]]
    cloth = np.where((x // 9 + y // 9) % 2, 60.0, 190.0)[..., None] * (1.0, 0.7, 0.5)
    skin = np.where(y[..., None] < 108, (200.0, 150, 130), cloth)
    return wall, skin, truth


def photographed(wall, person, truth, gain=1.0, noise=2.0, shadow=0.0, seed=9):
    """uint8 RGB, with the shadow a lamp from the left throws on the wall."""
    random = np.random.default_rng(seed)
    shade = 1 - shadow * cv2.GaussianBlur(np.roll(truth, 30, 1), (0, 0), 14)
    lit = wall * shade[..., None]
    mixed = truth[..., None] * person + (1 - truth[..., None]) * lit
    return np.clip(gain * mixed + random.normal(0, noise, lit.shape), 0, 255).astype(np.uint8)


def overlap(found, truth) -> float:
    """Intersection over union."""
    a, b = found > 127, truth > 0.5
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize(
    ("gain", "noise", "shadow"),
    ((1.0, 1.0, 0.0), (1.12, 2.0, 0.0), (0.9, 4.0, 0.0), (1.05, 2.0, 0.22)),
)
def test_noise_exposure_and_shadows_change_little(gain, noise, shadow):
    for seed in range(3):
        wall, person, truth = plate_and_person(seed)
        picture = photographed(wall, person, truth, gain, noise, shadow)
        plate = photographed(wall, person, 0 * truth, seed=1)
        found = matte(picture, plate)
        assert overlap(found, truth) > 0.97
        assert np.abs(found / 255 - truth).mean() < 0.012
        assert found[190, 62] < 30  # one sees the wall between arm and body


@pytest.mark.parametrize("blur", (0.5, 1.0, 1.5))
def test_opacity_along_an_edge_is_right_where_colours_are_even(blur):
    """A hard edge would be off by 0.15 to 0.27."""
    wall, _, truth = plate_and_person(0)
    person, truth = np.full_like(wall, (200.0, 150, 130)), cv2.GaussianBlur(truth, (0, 0), blur)
    found = matte(photographed(wall, person, truth, noise=1), photographed(wall, person, 0 * truth))
    edge = (truth > 0.1) & (truth < 0.9)
    edge[105:] = False  # the head
    assert np.abs(found[edge] / 255 - truth[edge]).mean() < 0.035


def test_nobody_gives_an_empty_mask():
    wall, person, truth = plate_and_person(0)
    nobody = photographed(wall, person, 0 * truth, gain=1.08, noise=3)
    assert not matte(nobody, photographed(wall, person, 0 * truth, seed=1)).any()


def recording(folder, cameras=2, frames=3):
    rig = multiview_folders.ring(cameras, SIZE)
    for index, camera in enumerate(rig):
        wall, person, truth = plate_and_person(index)
        multiview_folders.save(
            folder / f"backgrounds/{camera.name}.png",
            photographed(wall, person, 0 * truth, seed=index),
        )
        for frame in range(frames):
            moved = np.roll(truth, 9 * frame, 1)
            picture = photographed(wall, np.roll(person, 9 * frame, 1), moved, seed=frame)
            multiview_folders.save(folder / f"images/{camera.name}/{frame:06d}.png", picture)
    return multiview_folders.write_cameras(
        folder, [multiview_folders.entry(camera) for camera in rig], frames
    )


def test_the_command_writes_what_is_missing(tmp_path, capsys):
    folder = recording(tmp_path)
    mended = np.full((SIZE[1], SIZE[0]), 77, np.uint8)
    multiview_folders.save(folder / "masks/cam01/000001.png", mended)
    assert main(["capture", "masks", str(folder), "--workers", "2"]) == 0
    assert "5 masks written" in capsys.readouterr().out
    capture = open_capture(folder)
    for index in range(2):
        truth = plate_and_person(index)[2]
        for frame in range(3):
            if (index, frame) != (1, 1):
                found = capture.mask(index, frame) * 255
                assert overlap(found, np.roll(truth, 9 * frame, 1)) > 0.97
    np.testing.assert_array_equal(np.rint(capture.mask(1, 1) * 255), mended)
    assert main(["capture", "masks", str(folder)]) == 0
    assert "0 masks written" in capsys.readouterr().out
    assert main(["capture", "check", str(folder)]) == 0


def test_cameras_without_a_plate_are_said(tmp_path, caplog, capsys):
    folder = recording(tmp_path, frames=1)
    (folder / "backgrounds/cam00.png").unlink()
    with caplog.at_level(logging.WARNING):
        assert main(["capture", "masks", str(folder)]) == 0
    assert "camera cam00 has no clean plate" in caplog.text
    (folder / "backgrounds/cam01.png").unlink()
    assert main(["capture", "masks", str(folder)]) == 1
    assert "no clean plates" in capsys.readouterr().err


def test_a_damaged_picture_ends_it_with_its_name(tmp_path, capsys):
    folder = recording(tmp_path)
    (folder / "images/cam01/000002.png").write_bytes(b"\x89PNG")
    assert main(["capture", "masks", str(folder), "--workers", "1"]) == 1
    assert "camera cam01, frame 2" in capsys.readouterr().err


@pytest.mark.parametrize("link", ["masks", "masks/cam01"])
def test_nothing_is_written_where_a_link_leads(tmp_path, capsys, link):
    """The names of cameras, and so of folders, are those of whoever sent the recording."""
    folder, elsewhere = recording(tmp_path / "recording"), tmp_path / "elsewhere"
    elsewhere.mkdir()
    (folder / link).parent.mkdir(exist_ok=True)
    (folder / link).symlink_to(elsewhere)
    assert main(["capture", "masks", str(folder)]) == 1
    assert "leads out of the recording" in capsys.readouterr().err
    assert not any(elsewhere.iterdir())


def test_a_recording_is_opened_once_for_all_cameras(tmp_path, monkeypatch):
    """Opening takes time for each camera: once for each would be the square of that."""
    folder, opened = recording(tmp_path, cameras=4, frames=1), []
    monkeypatch.setattr(reader, "read_description", partial(counted, opened))
    assert make_masks(folder, 2) == 4
    parts = [opened_apart(capture) for capture in [open_capture(folder)] * 3]
    assert len(opened) == 2
    assert len({id(part.files) for part in parts}) == 3


def counted(opened, path):
    opened.append(path)
    return read_description(path)


def test_plates_of_another_size_are_refused():
    with pytest.raises(CaptureError, match="background"):
        matte(np.zeros((8, 8, 3), np.uint8), np.zeros((9, 8, 3), np.uint8))
