"""Damaged and incomplete recordings: known ones are read, others are one sentence."""

import logging
import shutil

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.cli import main as run
from ico3d.errors import CaptureError
from support.recordings import renderme_files

pytestmark = pytest.mark.slow


def fails(call, *words):
    with pytest.raises(CaptureError) as error:
        call()
    message = str(error.value)
    assert all(word in message for word in words), message
    assert "\n" not in message and message[-1] in ".?"


def annotations_of(raw):
    return raw.with_name(raw.name.replace("_raw", "_anno"))


def replace(path, inside, value):
    with h5py.File(path, "a") as file:
        del file[inside]
        if value is not None:
            file[inside] = value


@pytest.fixture
def raw(tmp_path):
    """A recording of five cameras and four frames."""
    return renderme_files.write_recording(tmp_path, renderme_files.Rig(cameras=(0, 22, 25, 28, 45)))


def test_a_sound_recording_is_checked_without_errors(raw, capsys):
    assert run(["capture", "check", str(raw)]) == 0
    said = capsys.readouterr().out
    assert "all 20 are there" in said and raw.with_suffix(".png").is_file()
    levels = {f.what: f.level for f in examine(open_capture(raw))}
    for what in ("views", "mask files", "FLAME", "face in space", "poses", "landmarks"):
        assert levels[what] == "ok", what


def test_missing_and_damaged_views_are_named(raw):
    replace(raw, "Camera/22/color/1", None)
    replace(raw, "Camera/28/color/3", np.zeros(50, np.uint8))
    replace(annotations_of(raw), "Camera/45/mask/2", None)
    capture = open_capture(raw)
    assert capture.image(1, 1) is None and capture.mask(4, 2) is None
    findings = {f.what: f for f in examine(capture)}
    assert findings["views"].level == "error"
    assert findings["views"].text == ("damaged: camera 28, frame 3; missing: camera 22, frame 1")
    assert findings["mask files"].text == "missing: camera 45, frame 2"
    fails(lambda: capture.image(3, 3), "camera 28, frame 3", "damaged")


def test_frames_without_a_fit_have_no_pose(tmp_path):
    rig = renderme_files.Rig(cameras=(22, 25), fitted=(1, 3))
    capture = open_capture(renderme_files.write_recording(tmp_path, rig))
    known = [capture.world_from_head(frame) is not None for frame in range(4)]
    assert known == [False, True, False, True]
    assert capture.flame(0) is None and capture.head_points(0) is None
    assert capture.landmarks_3d(0) is None and capture.landmarks(0, 0) is not None
    (finding,) = (f for f in examine(capture) if f.what == "FLAME")
    assert (finding.level, finding.text) == ("warn", "2 of 4 frames")


@pytest.mark.parametrize("nothing", (None, np.zeros((0, 2)), h5py.Empty("f8")))
def test_faces_that_a_camera_did_not_find(raw, nothing):
    replace(annotations_of(raw), "Keypoints2d/25/2", nothing)
    capture, rig = open_capture(raw), renderme_files.Rig()
    assert capture.keypoints_2d(2, 2) is None
    expected = rig.camera(25).project(renderme_files.face_in_files(rig, 2))[0] + 0.5
    np.testing.assert_allclose(capture.landmarks(2, 2), expected, atol=1e-4)


def test_faces_that_only_one_camera_found_stay_flat(raw):
    for camera in (22, 28):
        replace(annotations_of(raw), f"Keypoints2d/{camera}", None)
    capture = open_capture(raw)
    assert capture.landmarks(2, 0) is not None and capture.landmarks(1, 0) is None
    assert capture.landmarks_3d(0) is None and capture.world_from_head(0) is not None


def test_one_camera_that_errs_is_outvoted(tmp_path):
    rig = renderme_files.Rig(cameras=(18, 22, 25, 28, 32), frames=1)
    marks = open_capture(renderme_files.write_recording(tmp_path / "all", rig)).landmarks_3d(0)
    raw = renderme_files.write_recording(tmp_path / "errs", rig)
    wrong = renderme_files.landmarks(rig, 25, 0) + np.array([3.0, -2.0])
    replace(annotations_of(raw), "Keypoints2d/25/0", wrong)
    away = np.linalg.norm(open_capture(raw).landmarks_3d(0) - marks, axis=1)
    assert np.median(away) < 0.002  # where one of five with equal say moves them by 1 cm


def test_landmarks_in_another_order_are_left_out(tmp_path, caplog):
    raw = renderme_files.write_recording(
        tmp_path, renderme_files.Rig(cameras=(22, 25, 28), frames=2)
    )
    shuffled = np.random.default_rng(0).permutation(106)
    with h5py.File(annotations_of(raw), "a") as file:
        for camera in (22, 25, 28):
            for frame in range(2):
                marks = file[f"Keypoints2d/{camera}/{frame}"]
                marks[...] = marks[()][shuffled]
    capture = open_capture(raw)
    with caplog.at_level(logging.WARNING):
        for frame in range(2):
            assert capture.landmarks(1, frame) is None and capture.landmarks_3d(frame) is None
    (said,) = caplog.messages
    assert "order" in said
    assert capture.keypoints_2d(1, 0).shape == (106, 2) and capture.world_from_head(0) is not None


def test_cameras_without_calibration_are_left_out(raw, caplog):
    replace(annotations_of(raw), "Calibration/22", None)
    assert [c.name for c in open_capture(raw).cameras] == ["00", "25", "28", "45"]
    assert "22" in caplog.messages[0]


@pytest.mark.parametrize(
    ("inside", "value", "words"),
    (
        ("Calibration/25/RT", np.eye(4) * 2, "rotation"),
        ("Calibration/25/K", np.full((3, 3), np.nan), "finite"),
        ("Calibration/25/D", np.zeros(3), "shape"),
        ("Calibration/25/D", None, "no D"),
    ),
)
def test_damaged_calibrations_are_named(raw, inside, value, words):
    replace(annotations_of(raw), inside, value)
    fails(lambda: open_capture(raw), "25", words)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    (
        ("verts", np.zeros((5022, 3)), "FLAME/1/verts"),
        ("verts", np.full((5023, 3), np.nan), "finite"),
        ("verts", None, "missing"),
        ("cam", np.zeros(2), "translation"),
        ("global_pose", np.zeros(4), "4 values"),
    ),
)
def test_damaged_fits_are_named(raw, name, value, words):
    replace(annotations_of(raw), f"FLAME/1/{name}", value)
    capture = open_capture(raw)
    fails(lambda: capture.flame(1), "0026_e0_anno.smc", words)


def test_fits_of_other_shapes_of_array_are_read(raw, tmp_path):
    cam = renderme_files.flame(renderme_files.Rig(), 1)["cam"]
    other = shutil.copytree(raw.parent, tmp_path / "other") / raw.name  # none that is open yet
    replace(annotations_of(other), "FLAME/1/cam", cam[None])
    expected = open_capture(raw).world_from_head(1)
    np.testing.assert_array_equal(open_capture(other).world_from_head(1), expected)


def test_damaged_landmarks_and_sound_are_named(raw, tmp_path):
    replace(annotations_of(raw), "Keypoints2d/25/0", np.zeros((68, 2)))
    fails(lambda: open_capture(raw).landmarks(2, 0), "Keypoints2d/25/0", "106")
    rig = renderme_files.Rig(part="s1_all", cameras=(25,), frames=2, sound=np.full(48_000, 3000.0))
    loud = renderme_files.write_recording(tmp_path / "loud", rig)
    fails(lambda: open_capture(loud).audio(), "audio", "between -1 and 1")
    mute = renderme_files.write_recording(tmp_path / "mute", rig)
    replace(mute, "Camera/00/audio/sample_rate", 0)
    fails(lambda: open_capture(mute), "sample rate")


def test_annotations_must_be_there(raw):
    annotations = annotations_of(raw)
    fails(lambda: open_capture(annotations), "_raw.smc")
    annotations.unlink()
    fails(lambda: open_capture(raw), "0026_e0_anno.smc", "beside it")


def test_a_folder_of_several_recordings_needs_a_choice(raw):
    other = renderme_files.write_recording(
        raw.parent, renderme_files.Rig(cameras=(25,), part="h0", frames=1)
    )
    fails(lambda: open_capture(raw.parent), "2 recordings", "0026_e0_raw.smc, 0026_h0_raw.smc")
    assert open_capture(other).num_frames == 1


def test_frames_outside_the_recording(raw):
    capture = open_capture(raw)
    for call in (capture.world_from_head, capture.flame, capture.head_points, capture.landmarks_3d):
        for frame in (-1, 4):
            fails(lambda call=call, frame=frame: call(frame), "frames 0 to 3")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A small recording to be damaged."""
    rig = renderme_files.Rig(cameras=(22, 25), frames=1, size=(8, 8))
    return renderme_files.write_recording(tmp_path_factory.mktemp("sound"), rig)


def read_everything(path) -> None:
    capture = open_capture(path)
    for camera in range(len(capture.cameras)):
        capture.image(camera, 0), capture.mask(camera, 0), capture.landmarks(camera, 0)
    capture.flame(0), capture.landmarks_3d(0), capture.audio(), capture.inspect()


@settings(max_examples=40)
@given(data=st.data(), which=st.sampled_from(("_raw", "_anno")))
def test_files_cut_anywhere_are_one_sentence(sound, tmp_path_factory, data, which):
    folder = tmp_path_factory.mktemp("cut")
    for path in (sound, annotations_of(sound)):
        shutil.copy(path, folder)
    file = folder / f"0026_e0{which}.smc"
    whole = file.read_bytes()
    file.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    fails(lambda: read_everything(folder / sound.name), file.name)
