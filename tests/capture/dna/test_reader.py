"""What is written in the documented layout comes back."""

import io

import cv2
import h5py
import numpy as np
import pytest
from PIL import Image

from ico3d.capture.dna.calibration import colours
from ico3d.capture.formats import open_capture
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError
from support.recordings import dna_files

BENT = (-0.12, 0.05, 0.001, -0.002, 0.03)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A recording without distortion or colour correction."""
    return dna_files.write_recording(tmp_path_factory.mktemp("plain"))


def test_a_folder_and_its_main_file_are_the_same_recording(plain):
    for path in (plain, plain.parent):
        capture = open_capture(path)
        assert (capture.kind, capture.path) == ("dna-rendering", plain)
        assert (capture.fps, capture.num_frames) == (15.0, 3)
        assert [c.name for c in capture.cameras] == ["00", "01", "02", "03", "47", "48", "59"]
        assert {(c.width, c.height) for c in capture.cameras[:5]} == {(40, 48)}
        assert {(c.width, c.height) for c in capture.cameras[5:]} == {(56, 64)}
        assert capture.split.train == (0, 1, 2) and len(capture.split.test_cameras) == 1


def test_pictures_are_those_of_the_jpeg_decoder(plain):
    capture = open_capture(plain)
    for index, camera in enumerate((0, 1, 2, 3, 47, 48, 59)):
        size = dna_files.Rig().size(camera)
        stream = dna_files.encoded(dna_files.picture(camera, 2, size), "JPEG")
        expected = cv2.imdecode(stream, cv2.IMREAD_COLOR)[..., ::-1]
        image = capture.image(index, 2)
        assert image.dtype == np.float32
        np.testing.assert_array_equal(np.rint(image * 255), expected)
        np.testing.assert_array_equal(
            capture.mask(index, 2), dna_files.mask(camera, size)[..., 0] > 127
        )


def test_cameras_are_inverses_of_rt_turned_upright(plain):
    rig = dna_files.Rig()
    capture = open_capture(plain)
    turn = np.diag([1.0, -1.0, -1.0, 1.0])  # the world of this file has -y up
    for camera, number in zip(capture.cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(
            camera.camera_to_world, turn @ rig.camera_to_world(number), atol=1e-12
        )
        expected = rig.intrinsics(number)
        expected[:2, 2] += 0.5
        np.testing.assert_allclose(camera.intrinsics, expected)
        assert camera.camera_to_world[1, 3] == pytest.approx(0.2)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", (-1.0, 1.0))
def test_every_world_is_turned_so_that_y_is_up(tmp_path, axis, sign):
    up = np.zeros(3)
    up[axis] = sign
    rig = dna_files.Rig(cameras=(0, 5, 20, 40), frames=1, up=tuple(up))
    capture = open_capture(dna_files.write_recording(tmp_path, rig))
    for camera, number in zip(capture.cameras, rig.cameras, strict=True):
        turn = camera.camera_to_world @ np.linalg.inv(rig.camera_to_world(number))
        np.testing.assert_allclose(turn[:3, :3] @ up, [0, 1, 0], atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1)
        assert set(np.abs(turn[:3, :3]).round(12).ravel()) == {0.0, 1.0}
    fit = capture.smplx(0)
    np.testing.assert_allclose(fit.world_from_fit, turn, atol=1e-12)
    expected = dna_files.keypoints_3d(1)[0] @ turn[:3, :3].T
    np.testing.assert_allclose(capture.keypoints_3d(0), expected, atol=1e-12)


def slowly_corrected(image: np.ndarray, table: np.ndarray) -> np.ndarray:
    """x' = a x² + b x + c for each channel of a BGR picture, one value after the other."""
    out = np.empty_like(image)
    for y, x, channel in np.ndindex(image.shape):
        a, b, c = table[channel]
        value = float(image[y, x, channel])
        out[y, x, channel] = min(max(round(a * value * value + b * value + c), 0), 255)
    return out


def test_colours_follow_the_polynomials_of_blue_green_and_red(tmp_path):
    table = np.array([[0.001, 0.8, 5.0], [-0.0012, 1.2, -6.0], [0.0, 1.4, 0.25]])
    rig = dna_files.Rig(cameras=(0, 1, 2), frames=1, colours=table)
    image = open_capture(dna_files.write_recording(tmp_path, rig)).image(1, 0)
    stream = dna_files.encoded(dna_files.picture(1, 0, rig.size(1)), "JPEG")
    expected = slowly_corrected(cv2.imdecode(stream, cv2.IMREAD_COLOR), table)[..., ::-1]
    np.testing.assert_array_equal(np.rint(image * 255), expected)


def test_colours_saturate():
    ramp = colours(np.array([[0, 2.0, -100], [0, -3.0, 0], [1.0, 0, 0]]))
    assert ramp[:, 2].tolist() == [min(max(2 * x - 100, 0), 255) for x in range(256)]
    assert ramp[:, 1].max() == 0 and ramp[:, 0].tolist() == [min(x * x, 255) for x in range(256)]


def test_a_point_of_the_world_is_found_where_the_straightened_camera_sees_it(tmp_path):
    """A dot drawn where the bending lens sees a point lies where the pinhole camera says."""
    rig = dna_files.Rig(
        cameras=(0, 20, 50), frames=1, sizes=((300, 260), (340, 300)), distortion=BENT
    )
    world = np.array([[0.0, 0, 0], [0.3, -0.25, 0.1], [-0.35, 0.3, -0.2], [0.2, 0.35, 0.25]])
    for number, point in enumerate(world):
        main = dna_files.write_recording(tmp_path / str(number), rig)
        draw_point(main, rig, point)
        capture = open_capture(main)
        for index, camera in enumerate(capture.cameras):
            image, mask = capture.image(index, 0), capture.mask(index, 0)
            turned = point * (1, -1, -1)
            pixel, _ = camera.project(turned)
            for weights in (image.mean(-1), mask):
                y, x = np.mgrid[: camera.height, : camera.width] + 0.5
                middle = np.array([(weights * x).sum(), (weights * y).sum()]) / weights.sum()
                assert np.abs(middle - pixel).max() < 0.12


def draw_point(main, rig, point) -> None:
    """Puts a blurred dot into all pictures and a disc into all masks of a recording."""
    with (
        h5py.File(main, "a") as file,
        h5py.File(main.with_stem(f"{main.stem}_annots"), "a") as more,
    ):
        for number in rig.cameras:
            height, width = rig.size(number)
            world_to_camera = np.linalg.inv(rig.camera_to_world(number))
            turn, _ = cv2.Rodrigues(world_to_camera[:3, :3])
            where, _ = cv2.projectPoints(
                point[None], turn, world_to_camera[:3, 3], rig.intrinsics(number), np.array(BENT)
            )
            y, x = np.mgrid[:height, :width]
            far = np.hypot(x - where[0, 0, 0], y - where[0, 0, 1])
            dot = np.repeat((255 * np.exp(-((far / 4) ** 2)))[..., None], 3, -1).astype(np.uint8)
            group = "Camera_12mp" if number >= 48 else "Camera_5mp"
            replace(file, f"{group}/{number}/color/0", png(dot))
            disc = np.repeat(255 * (far < 9)[..., None], 3, -1).astype(np.uint8)
            replace(more, f"Mask/{number}/mask/0", png(disc))


def png(image):
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "PNG")
    return np.frombuffer(stream.getvalue(), np.uint8)


def replace(file, inside, data) -> None:
    del file[inside]
    file.create_dataset(inside, data=data)


def test_straightened_pictures_show_recorded_pixels_only(tmp_path):
    """No black rims, also with a large k3."""
    rig = dna_files.Rig(cameras=(0, 1, 2), frames=1, distortion=(-0.3, 0.1, 0, 0, 0.9))
    main = dna_files.write_recording(tmp_path, rig)
    with h5py.File(main, "a") as file:
        white = np.full((*rig.size(0), 3), 255, np.uint8)
        replace(file, "Camera_5mp/0/color/0", png(white))
    capture = open_capture(main)
    assert capture.image(0, 0).min() > 0.99
    assert not np.allclose(capture.cameras[0].intrinsics, rig.intrinsics(0), atol=1)


def test_keypoints_move_with_the_picture(tmp_path):
    rig = dna_files.Rig(cameras=(0, 1, 50), frames=2, distortion=BENT)
    capture = open_capture(dna_files.write_recording(tmp_path, rig))
    found = capture.keypoints_2d(2, 1)
    raw = dna_files.keypoints_2d(rig, 50)[1]
    np.testing.assert_array_equal(found[:, 2], raw[:, 2])
    matrix = capture.cameras[2].intrinsics.copy()
    matrix[:2, 2] -= 0.5
    rays = (found[:, :2] - 0.5 - matrix[:2, 2]) / np.diag(matrix)[:2]
    points = np.concatenate([rays, np.ones((len(rays), 1))], 1)
    bent, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), rig.intrinsics(50), np.array(BENT)
    )
    np.testing.assert_allclose(bent[:, 0], raw[:, :2], atol=1e-3)


def test_smplx_parameters_by_name(plain):
    parts, fit = dna_files.smplx(3), open_capture(plain).smplx(2)
    np.testing.assert_array_equal(fit.betas, parts["betas"][2])
    np.testing.assert_array_equal(fit.expression, parts["expression"][2])
    np.testing.assert_array_equal(fit.transl, parts["transl"][2])
    pose = parts["fullpose"][2]
    slices = (pose[0], pose[1:22], pose[22], pose[23:25], pose[25:40], pose[40:55])
    named = (fit.global_orient, fit.body_pose, fit.jaw_pose, fit.eye_poses)
    named += (fit.left_hand_pose, fit.right_hand_pose)
    for got, expected in zip(named, slices, strict=True):
        np.testing.assert_array_equal(got, expected)
    assert (fit.scale, fit.gender) == (1.02, "female")


def test_keypoints_of_all_frames_are_read_once(tmp_path, monkeypatch):
    rig = dna_files.Rig(cameras=(0, 1, 2), keypoints=np.ones((3, 133, 3)))
    capture, asked = open_capture(dna_files.write_recording(tmp_path, rig)), []
    numbers = SmcFile.numbers
    monkeypatch.setattr(SmcFile, "numbers", lambda *a, **k: asked.append(a) or numbers(*a, **k))
    assert all(len(capture.whole_body_points(frame)) == 133 for frame in range(3))
    assert len(asked) == 1


def test_depth_comes_as_it_was_measured(tmp_path):
    rig = dna_files.Rig(cameras=(0, 1, 2), frames=2)
    main = dna_files.write_recording(tmp_path, rig)
    assert open_capture(main).kinect is None
    dna_files.write_kinect(main, rig)
    kinect = open_capture(main).kinect
    assert kinect.cameras == (0, 7)
    np.testing.assert_array_equal(kinect.depth(7, 1), dna_files.depth(7, 1))
    np.testing.assert_array_equal(kinect.mask(0, 0), dna_files.mask(0, (12, 10))[..., 0] > 127)
    assert kinect.depth(7, 2) is None and kinect.mask(3, 0) is None
    place = kinect.calibration(7).camera_to_world
    expected = np.diag([1.0, -1, -1, 1]) @ rig.camera_to_world(56)
    np.testing.assert_allclose(place, expected, atol=1e-12)
    with pytest.raises(CaptureError, match="Kinect 03 has no calibration"):
        kinect.calibration(3)


def test_folders_of_the_data_set(tmp_path):
    main = dna_files.write_recording(
        tmp_path / "part_main", dna_files.Rig(cameras=(0, 1), frames=1)
    )
    other = tmp_path / "part_annotations"
    other.mkdir()
    (main.parent / "0012_11_annots.smc").rename(other / "0012_11_annots.smc")
    assert open_capture(main).num_frames == 1
