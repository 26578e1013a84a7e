"""Multiview folders: what lies in them comes back, and what does not is named."""

import json
import shutil

import cv2
import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.cli import main
from ico3d.common.camera import Camera, look_at
from ico3d.errors import CaptureError
from support.recordings import multiview_folders

BENT = [-0.2, 0.06, 0.002, -0.001, 0.01]


def fails(call, *words):
    with pytest.raises(CaptureError) as error:
        call()
    message = str(error.value)
    assert all(word in message for word in words), message
    assert "\n" not in message and message.endswith(".")


def test_pictures_come_back_as_they_were_saved(folder):
    capture = open_capture(folder)
    assert (capture.kind, capture.fps, capture.num_frames) == ("multiview", 30.0, 3)
    assert capture.split.train == (0, 1, 2) and len(capture.split.test_cameras) == 1
    for index, camera in enumerate(multiview_folders.ring(5)):
        np.testing.assert_array_equal(capture.cameras[index].intrinsics, camera.intrinsics)
        np.testing.assert_allclose(
            capture.cameras[index].world_to_camera, camera.world_to_camera, atol=1e-12
        )
        for frame in range(3):
            image = capture.image(index, frame)
            assert image.dtype == np.float32
            np.testing.assert_array_equal(
                np.rint(image * 255), multiview_folders.picture(index, frame)
            )
    assert capture.mask(0, 0) is None and capture.background(0) is None
    assert capture.audio() is None and capture.world_points() is None
    assert capture.provenance["consent"] == "not stated"


def test_masks_plates_points_and_sound(folder):
    coverage = np.arange(32 * 40, dtype=np.uint8).reshape(32, 40)
    multiview_folders.save(folder / "masks/cam01/000002.png", coverage)
    multiview_folders.save(folder / "backgrounds/cam01.jpg", np.full((32, 40, 3), 90, np.uint8))
    (folder / "points").mkdir()
    points = np.random.default_rng(0).normal(size=(7, 3)).astype(np.float32)
    np.save(folder / "points/000001.npy", points)
    soundfile.write(folder / "audio.wav", np.zeros((48_000, 2)), 48_000)
    capture = open_capture(folder)
    np.testing.assert_array_equal(np.rint(capture.mask(1, 2) * 255), coverage)
    assert capture.background(1) == pytest.approx(90 / 255, abs=1e-6)
    np.testing.assert_array_equal(capture.world_points(1), points)
    assert capture.world_points(0) is None and capture.head_points(1) is None
    assert len(capture.audio().samples) == 16_000


def test_transparency_is_a_mask_before_black(folder):
    solid = multiview_folders.picture(9, 9)
    alpha = np.arange(32 * 40, dtype=np.uint8).reshape(32, 40)
    multiview_folders.save(folder / "images/cam00/000000.png", np.dstack([solid, alpha]))
    capture = open_capture(folder)
    expected = solid * (alpha[..., None] / 255.0) / 255
    np.testing.assert_allclose(capture.image(0, 0), expected, atol=0.51 / 255)
    np.testing.assert_array_equal(np.rint(capture.mask(0, 0) * 255), alpha)


def test_a_point_of_the_world_is_found_where_the_straightened_camera_sees_it(tmp_path):
    """Pictures, masks and plates of a lens that bends lines are straightened alike."""
    size, point = (320, 240), np.array([0.5, 1.35, 0.2])
    rig = multiview_folders.ring(3, size)
    entries = []
    for camera in rig:
        matrix = camera.intrinsics * [[6], [6], [1]] - [
            [0, 0, 5 * size[0] / 2],
            [0, 0, 600],
            [0] * 3,
        ]
        entries.append(multiview_folders.entry(camera, intrinsics=matrix.tolist(), distortion=BENT))
        opencv = matrix - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
        turn, _ = cv2.Rodrigues(camera.world_to_camera[:3, :3])
        move = camera.world_to_camera[:3, 3]
        where, _ = cv2.projectPoints(point[None], turn, move, opencv, np.array(BENT))
        y, x = np.mgrid[: size[1], : size[0]]
        dot = 255 * np.exp(-((x - where[0, 0, 0]) ** 2 + (y - where[0, 0, 1]) ** 2) / 16)
        for kind in (f"images/{camera.name}/000000", f"masks/{camera.name}/000000"):
            multiview_folders.save(
                tmp_path / f"{kind}.png", np.repeat(dot[..., None], 3, 2).astype(np.uint8)
            )
        multiview_folders.save(tmp_path / f"backgrounds/{camera.name}.png", dot.astype(np.uint8))
    capture = open_capture(multiview_folders.write_cameras(tmp_path, entries, 1))
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    for index, camera in enumerate(capture.cameras):
        pixel, _ = camera.project(point)
        assert abs(pixel - np.array(size) / 2).max() > 40  # far from where lenses do nothing
        image, plate = capture.image(index, 0).mean(-1), capture.background(index).mean(-1)
        for weight in (image, plate, capture.mask(index, 0)):
            middle = np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()
            assert np.abs(middle - pixel).max() < 0.1


def test_a_sound_folder_is_checked_without_errors(folder, capsys):
    assert main(["capture", "check", str(folder)]) == 0
    assert "all 15 are there" in capsys.readouterr().out
    with Image.open(folder / "check.png") as sheet:
        assert sheet.width == 6 * 256


def test_missing_and_damaged_views_are_named(folder):
    (folder / "images/cam03/000001.png").unlink()
    (folder / "images/cam02/000002.png").write_bytes(b"\x89PNG nothing")
    capture = open_capture(folder)
    assert capture.image(3, 1) is None
    fails(lambda: capture.image(2, 2), "camera cam02, frame 2", "damaged")
    (finding,) = (f for f in examine(capture) if f.what == "views")
    assert finding.level == "error"
    assert finding.text == "damaged: camera cam02, frame 2; missing: camera cam03, frame 1"


def test_thousands_of_claimed_frames_take_no_time(folder, monkeypatch):
    about = json.loads((folder / "cameras.json").read_text())
    (folder / "cameras.json").write_text(json.dumps(about | {"num_frames": 10_000}))
    shutil.copytree(folder / "images", folder / "masks")
    (folder / "images/cam03/000001.png").unlink()
    (folder / "masks/cam03/000002.png").unlink()
    capture, asked = open_capture(folder), []
    file = capture.files.file
    monkeypatch.setattr(capture.files, "file", lambda *a: asked.append(a) or file(*a))
    found = {f.what: (f.level, f.text) for f in capture.inspect()}
    more = 5 * 10_000 - 14 - 1
    assert found["views"] == ("warn", f"missing: camera cam00, frame 3 (and {more} more)")
    assert found["mask files"][1].startswith("missing: camera cam03, frame 2")
    assert len(asked) < 200


def test_missing_frames_of_one_camera_are_counted(folder):
    for number in (0, 2):
        (folder / f"images/cam03/00000{number}.png").unlink()
    (finding,) = (f for f in examine(open_capture(folder)) if f.what == "views")
    assert finding.text == "missing: camera cam03, frame 0 (and 1 more)"


def test_cut_pictures_are_damaged_not_half_grey(folder):
    file = folder / "images/cam00/000000.png"
    file.write_bytes(file.read_bytes()[:-1500])
    fails(lambda: open_capture(folder).image(0, 0), "camera cam00, frame 0", "damaged")


def test_pictures_of_another_size_are_refused(folder):
    multiview_folders.save(
        folder / "images/cam00/000000.png", multiview_folders.picture(0, 0, (20, 20))
    )
    fails(lambda: open_capture(folder).image(0, 0), "20x20", "40x32")


def test_sixteen_bits_are_refused(folder):
    deep = Image.fromarray(np.full((32, 40), 40_000, np.uint16))
    deep.save(folder / "images/cam00/000000.png")
    fails(lambda: open_capture(folder).image(0, 0), "8 bits")


def test_a_camera_without_pictures_is_named(folder):
    rig = multiview_folders.ring(6)
    multiview_folders.write_cameras(folder, [multiview_folders.entry(camera) for camera in rig], 3)
    fails(lambda: open_capture(folder), "cam05", "videos/cam05.mp4")


def test_frames_outside_the_recording(folder):
    fails(lambda: open_capture(folder).image(0, 3), "frames 0 to 2")


@pytest.mark.parametrize(
    ("change", "words"),
    (
        ({"format": "other"}, "format"),
        ({"version": 2}, "version"),
        ({"fps": 0}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"num_frames": 10**400}, "num_frames"),
        ({"num_frames": "3"}, "num_frames"),
        ({"cameras": []}, "no cameras"),
    ),
)
def test_what_cannot_be_is_refused(folder, change, words):
    file = folder / "cameras.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    fails(lambda: open_capture(folder), "cameras.json", words)


@pytest.mark.parametrize(
    ("change", "words"),
    (
        ({"name": "../../etc"}, "name"),
        ({"name": ".hidden"}, "name"),
        ({"name": "CAM01"}, "called cam01"),
        ({"width": 0}, "width"),
        ({"intrinsics": [[1, 2], [3, 4]]}, "3x3"),
        ({"intrinsics": [[0, 0, 1], [0, 1, 1], [0, 0, 1]]}, "focal"),
        ({"world_to_camera": (2 * np.eye(4)).tolist()}, "rotation"),
        ({"distortion": [1, 2, 3]}, "distortion"),
        ({"distortion": "k1"}, "distortion"),
        ({"distortion": [1e9, 0, 0, 0, 0]}, "distortion"),
    ),
)
def test_cameras_that_cannot_be_are_refused(folder, change, words):
    file = folder / "cameras.json"
    about = json.loads(file.read_text())
    about["cameras"][0].update(change)
    file.write_text(json.dumps(about))
    fails(lambda: open_capture(folder), words)


def test_pickled_points_are_refused(folder):
    (folder / "points").mkdir()
    np.save(folder / "points/000000.npy", np.array([{"a": 1}], object), allow_pickle=True)
    fails(lambda: open_capture(folder).world_points(), "000000.npy", "damaged")


def test_points_that_claim_more_than_their_file_has_are_refused(folder):
    (folder / "points").mkdir()
    file = folder / "points/000000.npy"
    np.save(file, np.zeros((7, 3), np.float32))
    file.write_bytes(file.read_bytes().replace(b"(7, 3), }      ", b"(70000000000,3)"))
    fails(lambda: open_capture(folder).world_points(), "000000.npy", "damaged")


@settings(max_examples=60)
@given(data=st.data())
def test_descriptions_cut_or_changed_anywhere_are_one_sentence(tmp_path_factory, data):
    folder = multiview_folders.write_folder(tmp_path_factory.mktemp("cut"), 1, 1)
    file = folder / "cameras.json"
    text = file.read_text()
    place = data.draw(st.integers(0, len(text) - 1))
    kept = data.draw(st.sampled_from((text[place + 1 :], "")))
    file.write_text(text[:place] + data.draw(st.sampled_from(("", "9", "]", "e9", "null"))) + kept)
    try:
        open_capture(folder).image(0, 0)
    except CaptureError as error:
        assert "\n" not in str(error)


def test_a_folder_that_shows_a_head_is_split_by_time_and_has_its_hull(tmp_path):
    folder, middle, radius, frames = tmp_path / "head", np.array([0.1, 1.6, -0.2]), 0.1, 11
    lens = np.array([[50.0, 0, 20], [0, 50, 16], [0, 0, 1]])
    turns = np.arange(8) * np.pi / 4
    eyes = middle + 0.6 * np.stack([np.sin(turns), 0.3 * np.cos(2 * turns), np.cos(turns)], 1)
    cameras = [
        Camera(40, 32, lens, look_at(eye, middle), f"c{number}") for number, eye in enumerate(eyes)
    ]
    y, x = np.mgrid[:32, :40] + 0.5
    for camera, eye in zip(cameras, eyes, strict=True):
        away = np.linalg.norm(eye - middle)
        seen = 50 * radius / np.sqrt(away**2 - radius**2)  # pixels from the ball's middle
        ball = (255 * (np.hypot(x - 20, y - 16) < seen)).astype(np.uint8)
        multiview_folders.save(
            folder / f"images/{camera.name}/000000.png", multiview_folders.picture(0, 0)
        )
        multiview_folders.save(folder / f"masks/{camera.name}/000000.png", ball)
    entries = [multiview_folders.entry(camera) for camera in cameras]
    multiview_folders.write_cameras(folder, entries, frames, shows="head")
    capture = open_capture(folder)
    assert capture.split.train == tuple(range(10)) and capture.split.test == (10,)
    assert capture.head_points() is None  # nobody knows where head space is
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], middle - (0, 0.05, 0)
    zeros = [np.zeros((frames, *s), np.float32) for s in ((68, 3), (7,), (52,))]
    seen = np.ones((frames, len(cameras)), np.uint8)
    HeadTrack(np.tile(pose, (frames, 1, 1)), *zeros, seen).write(folder)
    points = open_capture(folder).head_points()
    np.testing.assert_allclose(points.mean(0), (0, 0.05, 0), atol=0.01)  # in head space
    away = np.linalg.norm(points - (0, 0.05, 0), axis=1)
    assert 0.9 * radius < away.min() and np.median(away) < 1.1 * radius
    multiview_folders.write_cameras(folder, entries, frames, shows="hands")
    fails(lambda: open_capture(folder), "shows must be")
