"""Recordings of COLMAP, nerfstudio and instant-ngp become multiview folders."""

import json
import shutil
from collections import Counter
from time import process_time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from ico3d.capture.formats import open_capture
from ico3d.capture.importing import transforms
from ico3d.capture.importing.recording import _free, import_recording
from ico3d.capture.importing.settings import ImportSettings
from ico3d.capture.multiview.description import read_json
from ico3d.capture.multiview.reader import MultiviewCapture
from ico3d.cli import main
from ico3d.errors import CaptureError, SettingsError
from support.recordings import foreign_models

Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a world with z up to one with y up, the shortest way."""


def imported(source, out, **settings) -> MultiviewCapture:
    import_recording(source, out, ImportSettings(**settings))
    capture = open_capture(out)
    assert isinstance(capture, MultiviewCapture)
    return capture


def fails(call, *words):
    with pytest.raises(CaptureError) as error:
        call()
    message = str(error.value)
    assert all(word in message for word in words), message
    assert "\n" not in message and message.endswith(".")


@pytest.mark.parametrize("binary", (True, False))
@pytest.mark.parametrize(
    "model", ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
)
def test_colmap_models_of_every_kind(tmp_path, model, binary):
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses(), model, binary)
    capture = imported(root, tmp_path / "out")
    assert capture.num_frames == 1 and len(capture.cameras) == 6
    assert capture.lenses[0].name == "first" and capture.lenses[1].name == "view_1"
    values = foreign_models.PARAMETERS[model]
    focal = (55.0, 57.0) if model in ("PINHOLE", "OPENCV") else (55.0, 55.0)
    bent = {
        "SIMPLE_RADIAL": (-0.1, 0, 0, 0),
        "RADIAL": (-0.1, 0.02, 0, 0),
        "OPENCV": values[4:],
    }.get(model, ())
    for index, lens in enumerate(capture.lenses):
        expected = [[focal[0], 0, 20.5], [0, focal[1], 16.5], [0, 0, 1]]
        np.testing.assert_array_equal(lens.intrinsics, expected)
        assert lens.distortion == bent
        recorded = capture.files.picture(index, 0)
        np.testing.assert_array_equal(recorded, foreign_models.picture(index))
    pose = capture.cameras[2].camera_to_world
    np.testing.assert_allclose(pose[:3, 3], Y_UP @ foreign_models.poses()[2, :3, 3], atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3], Y_UP @ foreign_models.poses()[2, :3, :3], atol=1e-9)
    np.testing.assert_allclose(capture.world_points(0), foreign_models.POINTS @ Y_UP.T, atol=1e-6)


def test_colmap_worlds_are_turned_upright_and_scaled(tmp_path):
    """Pictures and points keep their relation."""
    poses = foreign_models.tilted(foreign_models.poses())
    root = foreign_models.write_colmap(tmp_path / "scene", poses, "PINHOLE")
    capture = imported(root, tmp_path / "out", scale=2.5)
    centers = np.stack([camera.camera_to_world[:3, 3] for camera in capture.cameras])
    np.testing.assert_allclose(centers[:, 1], 2.5 * 0.5, atol=1e-9)
    np.testing.assert_allclose(np.hypot(centers[:, 0], centers[:, 2]), 2.5 * 2.0, atol=1e-9)
    for camera, pose in zip(capture.cameras, poses, strict=True):
        local = (foreign_models.POINTS - pose[:3, 3]) @ pose[:3, :3]
        pixels, depth = camera.project(capture.world_points(0))
        np.testing.assert_allclose(depth, 2.5 * local[:, 2], rtol=1e-5)
        expected = local[:, :2] / local[:, 2:] * (55, 57) + (20.5, 16.5)
        np.testing.assert_allclose(pixels, expected, atol=1e-3)


def test_smaller_pictures_than_those_calibrated(tmp_path):
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses(), "PINHOLE")
    half = tmp_path / "half"
    foreign_models.write_pictures(half, ["sub/first.png", *(f"view {i}.png" for i in range(1, 6))])
    for file in half.rglob("*.png"):
        with Image.open(file) as image:
            image.resize((20, 16)).save(file)
    capture = imported(root, tmp_path / "out", images=half)
    expected = [[27.5, 0, 10.25], [0, 28.5, 8.25], [0, 0, 1]]
    np.testing.assert_array_equal(capture.cameras[0].intrinsics, expected)
    assert (capture.cameras[0].width, capture.cameras[0].height) == (20, 16)


def test_lenses_that_are_not_read_are_named(tmp_path):
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses(), binary=False)
    file = root / "sparse/0/cameras.txt"
    file.write_text(file.read_text().replace("OPENCV", "OPENCV_FISHEYE"))
    fails(lambda: imported(root, tmp_path / "out"), "OPENCV_FISHEYE", "image_undistorter")
    assert not (tmp_path / "out").exists()


def test_pictures_of_colmap_that_are_not_there(tmp_path):
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses())
    (root / "images/view 3.png").unlink()
    fails(lambda: imported(root, tmp_path / "out"), "view 3.png", "missing")
    shutil.rmtree(root / "images")
    fails(lambda: imported(root, tmp_path / "out"), "--images")


def test_a_still_scene_of_nerfstudio(tmp_path):
    names = [f"images/frame_{i:05d}.png" for i in range(6)]
    foreign_models.write_pictures(tmp_path, names)
    entries = foreign_models.frames(foreign_models.poses(), names)
    entries[1]["fl_x"] = 60.0  # intrinsics of one frame
    foreign_models.write_transforms(
        tmp_path, entries, camera_model="OPENCV", k1=-0.05, k2=0.01, p1=1e-3
    )
    capture = imported(tmp_path, tmp_path / "out", likeness="Ada", consent="given", licence="CC0")
    assert [lens.name for lens in capture.lenses][:2] == ["frame_00000", "frame_00001"]
    assert [lens.intrinsics[0, 0] for lens in capture.lenses][:3] == [55, 60, 55]
    assert capture.lenses[4].distortion == (-0.05, 0.01, 1e-3, 0, 0)
    for index, pose in enumerate(foreign_models.poses()):
        found = capture.cameras[index].camera_to_world
        np.testing.assert_allclose(found[:3, :3], Y_UP @ pose[:3, :3], atol=1e-9)
        np.testing.assert_allclose(found[:3, 3], Y_UP @ pose[:3, 3], atol=1e-9)
        recorded = capture.files.picture(index, 0)
        np.testing.assert_array_equal(recorded, foreign_models.picture(index))
    assert capture.provenance == {
        "kind": "multiview",
        "sources": [f"transforms.json: {tmp_path.name}"],
        "likeness": "Ada",
        "consent": "given",
        "licence": "CC0",
    }


def test_the_axis_nearly_up_is_meant_to_be_up(tmp_path):
    """Cameras that all look down from one side do not tilt a world whose z is up."""
    names = ["a.png", "b.png"]
    foreign_models.write_pictures(tmp_path, names)
    poses = foreign_models.poses(8)[:2]
    foreign_models.write_transforms(tmp_path, foreign_models.frames(poses, names))
    capture = imported(tmp_path, tmp_path / "out")
    np.testing.assert_allclose(
        capture.cameras[0].camera_to_world[:3, 3], Y_UP @ poses[0, :3, 3], atol=1e-12
    )


def test_angles_of_instant_ngp_and_names_without_suffix(tmp_path):
    foreign_models.write_pictures(tmp_path, ["train/r_0.png"])
    frames = foreign_models.frames(foreign_models.poses(1), ["./train/r_0"])
    text = json.dumps({"camera_angle_x": 0.7, "frames": frames})
    (tmp_path / "transforms.json").write_text(text)
    (camera,) = imported(tmp_path / "transforms.json", tmp_path / "out").cameras
    focal = 20 / np.tan(0.35)
    expected = [[focal, 0, 20], [0, focal, 16], [0, 0, 1]]
    np.testing.assert_allclose(camera.intrinsics, expected)


def test_times_make_frames(tmp_path):
    """Three cameras at four times, one view missing; times from 0 to 1 as nerfstudio has them."""
    poses, entries, names = foreign_models.poses(3), [], []
    for camera in range(3):
        for frame in range(4):
            if (camera, frame) != (1, 2):
                names.append(f"cam{camera}/{frame}.png")
                entries += foreign_models.frames(
                    poses[camera : camera + 1], names[-1:], time=frame / 3
                )
    foreign_models.write_pictures(tmp_path, names)
    foreign_models.write_transforms(tmp_path, entries)
    capture = imported(tmp_path, tmp_path / "out", fps=15.0)
    assert (capture.num_frames, capture.fps) == (4, 15.0)
    assert [lens.name for lens in capture.lenses] == ["cam0", "cam1", "cam2"]
    assert capture.image(1, 2) is None
    number = names.index("cam1/3.png")
    np.testing.assert_array_equal(capture.files.picture(1, 3), foreign_models.picture(number))


def test_a_moving_camera_gives_one_view_for_each_frame(tmp_path):
    names = [f"r_{i}.png" for i in range(5)]
    foreign_models.write_pictures(tmp_path, names)
    entries = foreign_models.frames(foreign_models.poses(5), names)
    for index, entry in enumerate(entries):
        entry["time"] = 0.25 * index
    foreign_models.write_transforms(tmp_path, entries)
    capture = imported(tmp_path, tmp_path / "out")
    assert capture.num_frames == 5 and [lens.name for lens in capture.lenses][3] == "r_3"
    views = [[capture.image(c, f) is not None for f in range(5)] for c in range(5)]
    np.testing.assert_array_equal(views, np.eye(5, dtype=bool))


def test_masks_of_nerfstudio(tmp_path):
    foreign_models.write_pictures(tmp_path, ["a.png", "b.png"])
    mask = np.zeros((32, 40), np.uint8)
    mask[4:20] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    entries = foreign_models.frames(foreign_models.poses(2), ["a.png", "b.png"])
    entries[1]["mask_path"] = "mask.png"
    foreign_models.write_transforms(tmp_path, entries)
    capture = imported(tmp_path, tmp_path / "out")
    np.testing.assert_array_equal(capture.mask(1, 0), mask / 255)
    assert capture.mask(0, 0) is None


@pytest.mark.parametrize(
    ("change", "words"),
    (
        ({"file_path": "../outside.png"}, "outside"),
        ({"file_path": "none.png"}, "missing"),
        ({"file_path": 3}, "file_path"),
        ({"file_path": "a\0b"}, "missing"),
        ({"file_path": "notes.txt"}, "no JPEG or PNG"),
        ({"transform_matrix": [[1, 2], [3, 4]]}, "4x4"),
        ({"transform_matrix": np.diag([2.0, 2, 2, 1]).tolist()}, "rotation"),
        ({"transform_matrix": [[1e400]]}, "4x4"),
        ({"fl_x": -4}, "fl_x"),
        ({"fl_x": None, "camera_angle_x": None}, "camera_angle_x"),
        ({"w": 90}, "shape"),
        ({"k1": "a"}, "k1"),
        ({"camera_model": "OPENCV_FISHEYE"}, "OPENCV_FISHEYE"),
        ({"is_fisheye": True}, "fisheye"),
        ({"time": 0.1}, "some frames have a time"),
    ),
)
def test_frames_that_cannot_be_are_refused(tmp_path, change, words):
    root = tmp_path / "scene"
    foreign_models.write_pictures(tmp_path, ["outside.png"])
    foreign_models.write_pictures(root, ["a.png", "b.png"])
    (root / "notes.txt").write_text("no picture")
    entries = foreign_models.frames(foreign_models.poses(2), ["a.png", "b.png"])
    entries[1].update(change)
    foreign_models.write_transforms(root, entries)
    fails(lambda: imported(root, tmp_path / "out"), words)
    assert not (tmp_path / "out").exists() and len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("times", "words"),
    (((0, 0.1, 0.35), "evenly"), ((0, 0, 1), "one camera"), ((0, 1e-6, 1), "evenly")),
)
def test_times_that_make_no_frames(tmp_path, times, words):
    names = ["a.png", "b.png", "c.png"]
    foreign_models.write_pictures(tmp_path, names)
    entries = foreign_models.frames(np.repeat(foreign_models.poses(1), 3, 0), names)
    for entry, time in zip(entries, times, strict=True):
        entry["time"] = time
    foreign_models.write_transforms(tmp_path, entries)
    fails(lambda: imported(tmp_path, tmp_path / "out"), words)


def test_names_that_would_collide_or_escape(tmp_path):
    names = ["x/001.png", "y/001.png", "-.png", "Ä ö.png"]
    foreign_models.write_pictures(tmp_path, names)
    foreign_models.write_transforms(tmp_path, foreign_models.frames(foreign_models.poses(4), names))
    capture = imported(tmp_path, tmp_path / "out")
    assert [c.name for c in capture.cameras] == ["001", "001_2", "camera-", "___"]


def test_thousands_of_equal_names_are_told_apart_at_once():
    taken, begun = Counter(), process_time()
    names = [_free(name, taken) for name in ("a", "A_2", "a", *["a"] * 20_000)]
    assert names[:4] == ["a", "A_2", "a_3", "a_4"]
    assert len({name.lower() for name in names}) == len(names)
    assert process_time() - begun < 2


def test_a_picture_that_is_listed_twice_is_not_copied_for_each(tmp_path):
    foreign_models.write_pictures(tmp_path, ["a.png", "b.png"])
    names = ["a.png", "b.png", "./a.png"]
    foreign_models.write_transforms(tmp_path, foreign_models.frames(foreign_models.poses(3), names))
    fails(lambda: imported(tmp_path, tmp_path / "out"), "a.png is listed twice")


def test_a_picture_that_is_listed_ten_thousand_times_is_refused_at_once(tmp_path):
    """Also where the file has as many keys, and a model of COLMAP lists it."""
    foreign_models.write_pictures(tmp_path, ["a.png"])
    keys = {f"{number:x}": 0 for number in range(100_000)}
    entries = foreign_models.frames(foreign_models.poses(1), ["a.png"]) * 10_000
    foreign_models.write_transforms(tmp_path, entries, **keys)
    begun = process_time()
    fails(lambda: imported(tmp_path, tmp_path / "out"), "a.png is listed twice")
    assert process_time() - begun < 2
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses(), binary=False)
    file = root / "sparse/0/images.txt"
    file.write_text(file.read_text() * 10_000)
    begun = process_time()
    fails(lambda: imported(root, tmp_path / "out"), "is listed twice")
    assert process_time() - begun < 2


class Uncopied(dict):
    """An object of a file that may have millions of keys, which nobody goes through."""

    def __iter__(self):
        raise AssertionError("all keys were gone through")

    keys = __iter__


def test_no_frame_goes_through_all_keys_of_its_file(tmp_path, monkeypatch):
    names = [f"{number}.png" for number in range(4)]
    foreign_models.write_pictures(tmp_path, names)
    entries = foreign_models.frames(foreign_models.poses(4), names)
    entries[1]["fl_x"] = 60.0
    foreign_models.write_transforms(tmp_path, entries)
    monkeypatch.setattr(transforms, "read_json", lambda file: Uncopied(read_json(file)))
    shots = transforms.read_transforms(tmp_path / "transforms.json").shots
    assert [shot.lens.intrinsics[0, 0] for shot in shots] == [55, 60, 55, 55]


def test_a_mask_of_many_pictures_is_copied_once(tmp_path):
    names = ["a.png", "b.png", "c.png"]
    foreign_models.write_pictures(tmp_path, names)
    Image.new("L", (40, 32), 255).save(tmp_path / "mask.png")
    entries = foreign_models.frames(foreign_models.poses(3), names)
    for entry in entries:
        entry["mask_path"] = "mask.png"
    foreign_models.write_transforms(tmp_path, entries)
    capture = imported(tmp_path, tmp_path / "out")
    assert [capture.mask(camera, 0).mean() for camera in range(3)] == [1, 1, 1]
    masks = (tmp_path / "out" / "masks").glob("*/*.png")
    assert len({mask.stat().st_ino for mask in masks}) == 1


def test_the_command(tmp_path, capsys):
    root = foreign_models.write_colmap(tmp_path / "scene", foreign_models.poses())
    out = tmp_path / "out"
    assert main(["capture", "import", str(root), str(out), "--scale", "2"]) == 0
    assert "6 cameras, 1 frames" in capsys.readouterr().out
    assert main(["capture", "import", str(root), str(out)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert main(["capture", "import", str(tmp_path / "none"), str(out)]) == 1
    assert main(["capture", "import", str(out), str(tmp_path / "more")]) == 1
    assert "neither transforms.json nor" in capsys.readouterr().err
    assert main(["capture", "import", str(root), str(tmp_path / "flat"), "--scale", "0"]) == 1
    assert "fps and scale must be above 0, not 25 and 0." in capsys.readouterr().err
    with pytest.raises(SettingsError):
        ImportSettings(scale=0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Both kinds of COLMAP model over the same pictures."""
    root = tmp_path_factory.mktemp("fuzz")
    foreign_models.write_colmap(root / "bin", foreign_models.poses(2), "OPENCV", True)
    foreign_models.write_colmap(root / "txt", foreign_models.poses(2), "OPENCV", False)
    return root


@settings(max_examples=80)
@given(data=st.data(), kind=st.sampled_from(("bin", "txt")))
def test_models_cut_or_changed_anywhere_are_one_sentence(scene, tmp_path_factory, data, kind):
    root = tmp_path_factory.mktemp("cut") / kind
    shutil.copytree(scene / kind, root)
    name = data.draw(st.sampled_from(("cameras", "images", "points3D")))
    file = root / f"sparse/0/{name}.{kind}"
    whole = file.read_bytes()
    place = data.draw(st.integers(0, len(whole) - 1))
    kept = whole[place + 1 :] if data.draw(st.booleans()) else b""
    file.write_bytes(whole[:place] + data.draw(st.binary(max_size=3)) + kept)
    try:
        imported(root, root.parent / "out")
    except CaptureError as error:
        assert "\n" not in str(error) and not (root.parent / "out").exists()


@settings(max_examples=60)
@given(data=st.data())
def test_transforms_cut_or_changed_anywhere_are_one_sentence(tmp_path_factory, data):
    root = tmp_path_factory.mktemp("cut")
    foreign_models.write_pictures(root, ["a.png"])
    foreign_models.write_transforms(
        root, foreign_models.frames(foreign_models.poses(1), ["a.png"], time=0.5), k1=0.01
    )
    file = root / "transforms.json"
    text = file.read_text()
    place = data.draw(st.integers(0, len(text) - 1))
    kept = text[place + 1 :] if data.draw(st.booleans()) else ""
    file.write_text(text[:place] + data.draw(st.sampled_from(("", "9", "]", "e9", "-"))) + kept)
    try:
        imported(root, root / "out")
    except CaptureError as error:
        assert "\n" not in str(error)
