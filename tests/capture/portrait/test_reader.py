import io
import json
import shutil
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import wavfile
from scipy.spatial.transform import Rotation

from ico3d.capture.capture import EYE_NAMES
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.formats import open_capture
from ico3d.capture.portrait.files import camera_to_world, save_transforms
from ico3d.common.files import MOST_NOTES
from ico3d.errors import CaptureError
from support.recordings import portrait_folder


def _fails(folder: Path, *words: str) -> None:
    with pytest.raises(CaptureError) as error:
        open_capture(folder)
    message = str(error.value)
    assert all(word in message for word in words), message
    assert "\n" not in message


def test_what_a_folder_of_other_tools_holds(folder):
    capture = open_capture(folder)
    assert (capture.kind, capture.fps, capture.num_frames) == ("portrait", 25.0, 22)
    assert capture.split.train == tuple(range(20)) and capture.split.test == (20, 21)
    image = capture.image(0, 3)
    assert image.shape == (64, 64, 3) and image.dtype == np.float32 and image.max() <= 1
    assert capture.mask(0, 3).sum() == 16 * 32 + 16 * 32 + 8 * 16 + 16 * 48
    assert capture.head_mask(0, 3).sum() == 32 * 32
    assert capture.background(0) == pytest.approx(200 / 255, abs=2 / 255)
    assert capture.audio().rate == 16_000 and len(capture.audio().samples) == 22 * 640
    assert np.isfinite(capture.head_points()).all() and capture.head_points().shape[1] == 3
    assert capture.blendshapes(0) is None and capture.provenance["consent"] == "not stated"


def test_landmarks_lie_where_pose_and_camera_project_the_head(folder):
    capture = open_capture(folder)
    for frame in (0, 7, 21):
        camera = capture.cameras[0].moved(capture.world_from_head(frame))
        pixels, depths = camera.project(portrait_folder.head_points())
        assert (depths > 0).all()
        np.testing.assert_allclose(pixels, capture.landmarks(0, frame), atol=1e-6)


poses = st.builds(
    lambda turn, move: _rigid(turn, move),
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-5, -0.1)),
)


def _rigid(turn, move):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    pose[:3, 3] = move
    return pose


@settings(max_examples=40)
@given(pose=poses)
def test_any_pose_survives_the_layout(pose, tmp_path_factory):
    np.testing.assert_allclose(camera_to_world(pose) @ pose, np.eye(4), atol=1e-12)
    folder = tmp_path_factory.mktemp("round") / "person"
    (folder / "ori_imgs").mkdir(parents=True)
    portrait_folder.Image.new("RGB", (64, 64)).save(folder / "ori_imgs" / "0.jpg")
    save_transforms(folder, portrait_folder.FOCAL, (32.0, 32.0), [0, 1], np.stack([pose, pose]))
    shutil.copy(folder / "ori_imgs" / "0.jpg", folder / "ori_imgs" / "1.jpg")
    capture = open_capture(folder)
    np.testing.assert_allclose(capture.world_from_head(0), pose, atol=1e-12)
    point = np.array([0.01, -0.02, 0.03])
    seen, depth = capture.cameras[0].moved(capture.world_from_head(0)).project(point)
    local = pose[:3, :3] @ point + pose[:3, 3]
    assert depth == pytest.approx(-local[2])
    if local[2] < -1e-3:
        np.testing.assert_allclose(
            seen, portrait_folder.project(pose, point[None])[0], rtol=1e-9, atol=1e-6
        )
    # Columns 1 and 2 of the camera negated, then inverted: OpenCV's world to camera.
    opencv = np.linalg.inv(camera_to_world(pose) @ np.diag([1, -1, -1, 1]))
    whole = capture.cameras[0].world_to_camera @ capture.world_from_head(0)
    np.testing.assert_allclose(whole, opencv, atol=1e-12)


def test_eyes_from_action_units(folder):
    eyes = open_capture(folder).eyes(4)
    expected = {"browDown": 1.0, "browInnerUp": 0.5, "browOuterUp": 0.2, "eyeBlink": 0.5}
    for name, value in zip(EYE_NAMES, eyes, strict=True):
        assert value == pytest.approx(expected[name.removesuffix("Left").removesuffix("Right")])


def test_blendshapes_come_before_action_units(folder):
    rows = np.zeros((22, 52), np.float32)
    rows[:, BLENDSHAPES.index("eyeBlinkLeft")] = np.arange(22) / 22  # a line: smoothing keeps it
    np.save(folder / "bs.npy", rows)
    capture = open_capture(folder)
    assert capture.blendshape_names == BLENDSHAPES
    np.testing.assert_allclose(capture.eyes(11), [0, 0, 0, 0, 0, 0.5, 0], atol=1e-6)


def test_sound_of_another_rate_is_resampled(folder):
    wavfile.write(folder / "aud.wav", 48_000, np.zeros((48_000, 2), np.int16))
    assert len(open_capture(folder).audio().samples) == 16_000


def test_no_sound_is_none(folder):
    (folder / "aud.wav").unlink()
    assert open_capture(folder).audio() is None


def test_frames_without_a_face_keep_their_number(folder):
    ids = [i for i in range(22) if i != 9]
    portrait_folder.write_transforms(folder, ids, portrait_folder.head_poses()[ids])
    (folder / "ori_imgs" / "9.lms").unlink()
    capture = open_capture(folder)
    assert capture.num_frames == 22 and 9 not in capture.split.train
    assert capture.image(0, 9) is None and capture.world_from_head(9) is None
    np.testing.assert_allclose(
        capture.world_from_head(10), portrait_folder.head_poses()[10], atol=1e-9
    )


def test_missing_frame(folder):
    (folder / "ori_imgs" / "5.jpg").unlink()
    (folder / "gt_imgs" / "5.jpg").unlink()
    _fails(folder, "frame 5", "ori_imgs/5.jpg", "missing")


def test_landmarks_that_claim_gigabytes_are_not_read(folder):
    with (folder / "ori_imgs" / "5.lms").open("r+b") as hole:
        hole.truncate(1 << 32)
    with pytest.raises(CaptureError, match=r"5\.lms.*no small file"):
        open_capture(folder).landmarks(0, 5)


def test_ids_off_by_one(folder):
    portrait_folder.write_transforms(folder, list(range(1, 23)), portrait_folder.head_poses())
    _fails(folder, "frame 22", "missing")


def test_ids_that_count_only_frames_with_landmarks(folder):
    (folder / "ori_imgs" / "9.lms").unlink()
    kept = [i for i in range(22) if i != 9]
    portrait_folder.write_transforms(folder, list(range(21)), portrait_folder.head_poses()[kept])
    _fails(folder, "img_id", "off from frame 9", "9.lms")


def test_rows_that_count_only_frames_with_a_face(folder):
    np.save(folder / "bs.npy", np.zeros((21, 52), np.float32))
    _fails(folder, "bs.npy", "21 rows", "22 frames")


def test_action_unit_rows_are_counted(folder):
    portrait_folder.write_action_units(folder, 20)
    _fails(folder, "au.csv", "20 rows", "22 frames")


def test_nan_pose(folder):
    poses = portrait_folder.head_poses()
    portrait_folder.write_transforms(folder, list(range(22)), poses)
    file = folder / "transforms_val.json"
    content = json.loads(file.read_text())
    content["frames"][1]["transform_matrix"][0][3] = float("nan")
    file.write_text(json.dumps(content))
    _fails(folder, "transforms_val.json", "frame 21", "NaN")


def test_pose_that_is_no_rotation(folder):
    poses = portrait_folder.head_poses()
    poses[3, :3, :3] *= 1.1
    portrait_folder.write_transforms(folder, list(range(22)), poses)
    _fails(folder, "frame 3", "rotation")


def test_nan_blendshapes(folder):
    rows = np.zeros((22, 52), np.float32)
    rows[6, 2] = np.nan
    np.save(folder / "bs.npy", rows)
    _fails(folder, "bs.npy", "row 6", "NaN")


def test_pickled_arrays_are_refused(folder):
    np.save(folder / "bs.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    _fails(folder, "bs.npy", "cannot be read")


def test_a_hole_of_bytes_counts_as_what_it_would_become(folder):
    """4 kB of a disk, 256 MiB of bytes, which were copied as numbers of four."""
    head = _npy(_shaped("'|u1'", f"({(1 << 28) // 52},52)"))
    with (folder / "bs.npy").open("wb") as file:
        file.write(head)
        file.truncate(len(head) + (1 << 28))
    tracemalloc.start()
    _fails(folder, "bs.npy", "too many")
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


def _npy(head: str, data: bytes = b"") -> bytes:
    """A .npy file with any header."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head.encode() + b"\n" + data


def _shaped(descr: str, shape: str) -> str:
    return f"{{'descr':{descr},'fortran_order':False,'shape':{shape}}}"


def _npz() -> bytes:
    out = io.BytesIO()
    np.savez(out, a=np.zeros(3))
    return out.getvalue()


@pytest.mark.parametrize(
    "data",
    [
        _npz(),
        _npy(_shaped("'<f4'", "(100000000000,52)")),
        _npy(_shaped("'<f4'", "(-1,52)"), bytes(624)),
        _npy(_shaped("'<f4'", "()"), bytes(4)),
        _npy(_shaped("'<U5'", "(22,52)"), bytes(20 * 22 * 52)),
        _npy(_shaped("'<c8'", "(22,52)"), bytes(8 * 22 * 52)),
        _npy(_shaped("[('a','<f4')]", "(22,)"), bytes(88)),
        _npy("(" * 300 + ")" * 300),
        b"",
    ],
)
def test_strange_arrays_are_one_sentence(folder, data):
    (folder / "bs.npy").write_bytes(data)
    _fails(folder, "bs.npy")
    (folder / "bs.npy").unlink()
    (folder / "points.npy").write_bytes(data)
    with pytest.raises(CaptureError, match=r"points\.npy"):
        open_capture(folder).head_points()


@pytest.mark.parametrize("names", [5, None, [[1]] * 52, "jawOpen"])
def test_names_that_are_none_are_told(folder, names):
    np.save(folder / "bs.npy", np.zeros((22, 52), np.float32))
    (folder / "ico3d.json").write_text(json.dumps({"blendshape_names": names}))
    _fails(folder, "ico3d.json", "blendshape_names")


def test_damaged_json(folder):
    (folder / "transforms_train.json").write_text('{"frames": [')
    _fails(folder, "transforms_train.json", "no JSON")


def test_scaled_pictures_do_not_fit_the_lens(folder):
    for frame in range(22):
        portrait_folder.Image.new("RGB", (16, 16)).save(folder / "gt_imgs" / f"{frame}.jpg")
    _fails(folder, "principal point", "16x16")


def test_nothing_there(tmp_path):
    _fails(tmp_path / "nowhere", "there is no capture")
    _fails(tmp_path, "in no format known here")


@pytest.mark.parametrize(
    ("details", "word"), [({"fps": "fast"}, "fps"), ({"num_frames": 1e300}, "num_frames")]
)
def test_impossible_details_are_named(folder, details, word):
    (folder / "ico3d.json").write_text(json.dumps(details))
    _fails(folder, "ico3d.json", word)


def test_a_frame_that_is_no_object(folder):
    (folder / "transforms_train.json").write_text('{"frames": [1]}')
    _fails(folder, "transforms_train.json", "img_id")


def test_action_units_in_another_encoding(folder):
    (folder / "au.csv").write_bytes(b"\xff\xfe")
    _fails(folder, "au.csv", "cannot be read")


def test_a_table_that_takes_no_room_on_a_disk_is_not_read(folder):
    with (folder / "au.csv").open("wb") as file:
        file.truncate(MOST_NOTES + 1)
    _fails(folder, "au.csv", "no small file")


def test_a_table_of_action_units_is_not_kept_as_text(folder):
    """A single sign of four bytes made each letter as large."""
    head, *rows = (folder / "au.csv").read_text().splitlines()
    signs = "1" * 20_000
    lines = [f"{head},\U0001f600", *(f"{row},{signs}" for row in rows)]
    (folder / "au.csv").write_text("\n".join(lines), "utf-8")
    size = (folder / "au.csv").stat().st_size
    capture = open_capture(folder)
    vars(capture).pop("_action_units")  # read when the folder was opened
    tracemalloc.start()
    try:
        assert len(capture._action_units["AU45_r"]) == len(rows)
        assert tracemalloc.get_traced_memory()[1] < 3 * size
    finally:
        tracemalloc.stop()


def test_half_a_picture_of_a_parsing(folder):
    file = folder / "parsing" / "0.png"
    file.write_bytes(file.read_bytes()[:60])
    capture = open_capture(folder)
    with pytest.raises(CaptureError, match=r"0\.png cannot be read"):
        capture.mask(0, 0)


@pytest.mark.parametrize("focal", [10**400, -(10**400), float("nan"), "1", None])
def test_a_focal_length_that_is_no_number_in_pixels_is_told(folder, focal):
    file = folder / "transforms_train.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"focal_len": focal}))
    _fails(folder, "transforms_train.json", "must be numbers in pixels")


@pytest.mark.parametrize("number", [10**400, -1, 10**7, True])
def test_a_number_that_no_picture_has_is_told(folder, number):
    file = folder / "transforms_val.json"
    content = json.loads(file.read_text())
    content["frames"][0] |= {"img_id": number, "aud_id": number}
    file.write_text(json.dumps(content))
    _fails(folder, "transforms_val.json", "needs a whole img_id")


def test_pictures_that_are_named_otherwise_count_nothing(folder):
    before = open_capture(folder).num_frames
    for name in ("\u00b2", "\u0663\u0663", "9" * 50):
        (folder / "ori_imgs" / f"{name}.jpg").touch()
    assert open_capture(folder).num_frames == before


@pytest.mark.parametrize(
    ("stated", "what"),
    [
        ({"likeness": 5}, "provenance.likeness must be a text"),
        ({"consent": None}, "provenance.consent must be a text"),
        ({"kind": []}, "provenance.kind must be a text"),
        ({"sources": 5}, "provenance.sources must be a list"),
        ({"sources": [5]}, "provenance.sources must be a list"),
        ([], "provenance must be an object"),
        (5, "provenance must be an object"),
    ],
)
def test_what_states_nothing_of_a_person_is_told(folder, stated, what):
    (folder / "ico3d.json").write_text(json.dumps({"provenance": stated}))
    _fails(folder, "ico3d.json", what)
