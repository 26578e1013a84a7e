"""What is written in the documented layout comes back."""

import shutil

import cv2
import h5py
import numpy as np
import pytest
from scipy.spatial import KDTree

from ico3d.capture.formats import open_capture
from support.recordings import faces, renderme_files

pytestmark = pytest.mark.slow

UP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From the world of the files, which has +y down, to the capture's."""


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A recording without distortion."""
    return renderme_files.write_recording(tmp_path_factory.mktemp("plain"))


def test_a_folder_and_its_raw_file_are_the_same_recording(plain):
    for path in (plain, plain.parent):
        capture = open_capture(path)
        assert (capture.kind, capture.path) == ("renderme-360", plain)
        assert (capture.fps, capture.num_frames) == (30.0, 4)
        assert [c.name for c in capture.cameras] == ["00", "18", "22", "25", "28", "32", "45"]
        assert {(c.width, c.height) for c in capture.cameras} == {(48, 40)}
        assert (capture.split.train, capture.split.test) == ((0, 1, 2), (3,))
        assert "0026_e0" in capture.provenance["sources"][0]


def test_annotations_in_the_folders_of_the_data_set(plain, tmp_path):
    raw, anno = tmp_path / "raw" / "0026", tmp_path / "anno" / "0026"
    for folder, kind in ((raw, "raw"), (anno, "anno")):
        folder.mkdir(parents=True)
        (folder / f"0026_e0_{kind}.smc").symlink_to(plain.with_name(f"0026_e0_{kind}.smc"))
    apart, together = open_capture(raw), open_capture(plain)
    for frame in range(4):
        pose = together.world_from_head(frame)
        np.testing.assert_array_equal(apart.world_from_head(frame), pose)
        for camera in range(7):
            np.testing.assert_array_equal(apart.mask(camera, frame), together.mask(camera, frame))
    assert np.linalg.norm(pose - together.world_from_head(0)) > 1e-3  # the head moves


def test_pictures_are_those_of_the_jpeg_decoder_and_mattes_keep_their_edges(plain):
    capture = open_capture(plain)
    for index, camera in enumerate(renderme_files.Rig().cameras):
        stream = renderme_files.encoded(renderme_files.picture(camera, 2, (40, 48)), "JPEG")
        expected = cv2.imdecode(stream, cv2.IMREAD_COLOR)[..., ::-1]
        image, mask = capture.image(index, 2), capture.mask(index, 2)
        assert image.dtype == np.float32 and mask.dtype == np.float32
        np.testing.assert_array_equal(np.rint(image * 255), expected)
        np.testing.assert_array_equal(np.rint(mask * 255), renderme_files.matte((40, 48)).max(-1))
    assert ((mask > 0.1) & (mask < 0.9)).any()


def test_cameras_are_inverses_of_rt_in_a_world_with_y_up(plain):
    rig = renderme_files.Rig()
    for camera, number in zip(open_capture(plain).cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(
            camera.camera_to_world, UP @ rig.camera_to_world(number), atol=1e-12
        )
        expected = rig.intrinsics()
        expected[:2, 2] += 0.5
        np.testing.assert_allclose(camera.intrinsics, expected)
        assert camera.camera_to_world[1, 3] == pytest.approx(0.1)


def test_pictures_and_landmarks_are_straightened_alike(tmp_path):
    rig = renderme_files.Rig(
        cameras=(25, 28), frames=1, size=(300, 360), distortion=(-0.1, 0.05, 0, 0, 0.03)
    )
    raw = renderme_files.write_recording(tmp_path, rig)
    world = renderme_files.face_in_files(rig, 0)
    with h5py.File(raw.with_name("0026_e0_anno.smc"), "a") as file:
        for number in rig.cameras:
            to_camera = np.linalg.inv(rig.camera_to_world(number))
            bent, _ = cv2.projectPoints(
                world, cv2.Rodrigues(to_camera[:3, :3])[0], to_camera[:3, 3],
                rig.intrinsics(), np.array(rig.distortion),
            )  # fmt: skip
            marks = file[f"Keypoints2d/{number}/0"]
            values = marks[()]
            values[renderme_files.MULTI_PIE] = bent[:, 0]
            marks[...] = values
    capture = open_capture(raw)
    for index, camera in enumerate(capture.cameras):
        expected = camera.project(world @ UP[:3, :3])[0]
        np.testing.assert_allclose(capture.landmarks(index, 0), expected, atol=0.01)


def test_the_head_is_the_skull_of_the_fits(tmp_path):
    """Also while the neck bends, the jaw opens and the brows rise."""
    rig = renderme_files.Rig(frames=40, cameras=(22, 25))
    capture = open_capture(renderme_files.write_recording(tmp_path, rig, same_picture=True))
    found = np.stack([capture.world_from_head(frame) for frame in range(40)])
    assert max(faces.errors(found, rig.world_from_skull())) < 1e-6
    fixed = np.linalg.inv(rig.world_from_skull()[7]) @ found[7]
    np.testing.assert_allclose(fixed[:3, :3], np.eye(3), atol=1e-9)  # FLAME's axes
    assert np.linalg.norm(fixed[:3, 3]) < 0.15  # the middle of the skull
    for frame in (0, 31):
        local = capture.head_points(frame)
        world = (
            renderme_files.flame_vertices(rig, frame) + renderme_files.flame(rig, frame)["cam"][1:]
        )
        again = faces.moved(found[frame][None], local)[0]
        wanted = world @ UP[:3, :3]
        near = np.linalg.norm(wanted - found[frame, :3, 3], axis=1) < 0.25
        np.testing.assert_allclose(again, wanted[near], atol=1e-9)
        expected = rig.world_from_skull()[frame]
        face = faces.moved(expected[None], faces.face())[0]
        marks = faces.moved(found[frame][None], capture.landmarks_3d(frame))[0]
        np.testing.assert_allclose(marks, face, atol=1e-6)


def test_the_parts_of_a_fit(plain):
    fit, parts = open_capture(plain).flame(2), renderme_files.flame(renderme_files.Rig(), 2)
    pairs = {"global_pose": "global_pose", "neck_pose": "neck_pose", "jaw_pose": "jaw_pose"}
    for name, held in {**pairs, "shape": "shape", "expression": "exp"}.items():
        np.testing.assert_array_equal(getattr(fit, name), parts[held])
    eyes = np.stack([parts["left_eye_pose"], parts["right_eye_pose"]])
    np.testing.assert_array_equal(fit.eye_poses, eyes)
    expected = (parts["verts"] + parts["cam"][1:4]) @ UP[:3, :3]
    np.testing.assert_allclose(fit.vertices, expected, atol=1e-12)


def test_landmarks_are_read_where_there_are_some_and_projected_elsewhere(plain):
    capture, rig = open_capture(plain), renderme_files.Rig()
    for index, number in enumerate(rig.cameras):
        expected = rig.camera(number).project(renderme_files.face_in_files(rig, 1))[0] + 0.5
        np.testing.assert_allclose(capture.landmarks(index, 1), expected, atol=1e-4)
    assert capture.keypoints_2d(0, 1) is None and capture.keypoints_2d(3, 1).shape == (106, 2)
    raw = np.random.default_rng(1).normal(size=(73, 3))
    np.testing.assert_allclose(capture.keypoints_3d(1), raw @ UP[:3, :3])


def test_heads_of_parts_without_fits_come_from_landmarks(tmp_path):
    rig = renderme_files.Rig(part="h1_2b", frames=20, size=(200, 240))
    capture = open_capture(renderme_files.write_recording(tmp_path, rig, same_picture=True))
    assert capture.flame(0) is None
    found = np.stack([capture.world_from_head(frame) for frame in range(20)])
    assert max(faces.errors(found, rig.world_from_skull())) < 1e-5
    face = faces.moved(rig.world_from_skull()[:1], faces.face())[0]
    marks = faces.moved(found[:1], capture.landmarks_3d(0))[0]
    np.testing.assert_allclose(marks, face, atol=1e-6)
    hull = capture.head_points(0)  # of round mattes: a ball
    assert len(hull) > 1000 and np.linalg.norm(hull, axis=1).max() < 0.25


def test_the_hull_takes_mattes_of_other_frames_where_a_frame_has_few(tmp_path):
    rig = renderme_files.Rig(part="h0", frames=6, cameras=(0, 10, 22, 25, 28, 45), size=(80, 96))
    raw = renderme_files.write_recording(tmp_path, rig, same_picture=True)
    all_views = open_capture(raw).head_points(0)
    thin = renderme_files.write_recording(tmp_path / "thin", rig, same_picture=True)
    with h5py.File(thin.with_name("0026_h0_anno.smc"), "a") as file:
        for turn, camera in enumerate(rig.cameras):
            for frame in set(range(6)) - {turn}:
                del file[f"Camera/{camera:02d}/mask/{frame}"]
    few = open_capture(thin).head_points(0)
    near, _ = KDTree(all_views[::5]).query(few)
    assert len(few) > 0.5 * len(all_views) and np.median(near) < 0.02


@pytest.mark.parametrize("place", ("raw", "anno"))
@pytest.mark.parametrize("channels", (1, 2))
def test_sound_lies_in_either_file(tmp_path, place, channels):
    tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(48_000 * 2) / 48_000)
    sound = tone if channels == 1 else np.stack([tone, tone], 1)
    rig = renderme_files.Rig(part="s1_all", cameras=(25,), frames=60, sound=sound, sound_in=place)
    capture = open_capture(renderme_files.write_recording(tmp_path, rig, same_picture=True))
    heard = capture.audio()
    assert heard.rate == 16_000 and len(heard.samples) == 32_000
    expected = 0.5 * np.sin(2 * np.pi * 440 * np.arange(32_000) / 16_000)
    np.testing.assert_allclose(heard.samples[500:-500], expected[500:-500], atol=1e-3)
    assert capture.fps == 30 and capture.world_from_head(0) is None


def test_the_sound_tells_the_frame_rate(tmp_path):
    rig = renderme_files.Rig(part="s3_all", cameras=(22, 25), frames=30, sound=np.zeros(48_000 * 2))
    assert open_capture(renderme_files.write_recording(tmp_path, rig, same_picture=True)).fps == 15


def test_speech_by_38_cameras_has_15_frames_per_second(tmp_path):
    rig = renderme_files.Rig(
        part="s3_all", cameras=tuple(range(38)), frames=2, size=(8, 10), seen=False
    )
    raw = renderme_files.write_recording(tmp_path, rig)
    with h5py.File(raw, "a") as file:
        for number in range(38, 60):  # listed, but they took no part
            file.create_group(f"Camera/{number}/color")
    capture = open_capture(raw)
    assert capture.fps == 15 and len(capture.cameras) == 38
    assert (
        open_capture(
            renderme_files.write_recording(tmp_path / "e", renderme_files.Rig(frames=2))
        ).fps
        == 30
    )


def test_what_was_not_recorded_is_not_made_up(plain, tmp_path):
    """The same recording has sound until that is taken out; no part has eyes or clean plates."""
    silent = open_capture(plain)
    rig = renderme_files.Rig(sound=np.full(48_000, 0.25), sound_in="anno")
    heard = open_capture(renderme_files.write_recording(tmp_path / "heard", rig))
    assert len(heard.audio().samples) == 16_000 and heard.audio().samples[8000] > 0.2
    for capture in (silent, heard):
        assert capture.eyes(0) is None and capture.background(0) is None
    mute = shutil.copytree(heard.path.parent, tmp_path / "mute")
    with h5py.File(mute / "0026_e0_anno.smc", "a") as file:
        del file["Camera/00/audio"]
    assert silent.audio() is None and open_capture(mute).audio() is None
