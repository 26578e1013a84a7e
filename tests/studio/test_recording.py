"""Synthetic captures: what is written is exact, and the same every time."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError, SettingsError
from ico3d.studio import recording
from ico3d.studio.choice import load_subject
from ico3d.studio.points import surface_points
from ico3d.studio.recording import choose_views, record
from support.needs import needs
from support.recordings import synthetic_people
from support.shared import SUBJECTS

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return synthetic_people.write_person(tmp_path_factory.mktemp("people") / "block.npz")


@pytest.fixture(scope="module")
def folder(person, tmp_path_factory):
    out = tmp_path_factory.mktemp("captures") / "one"
    record(synthetic_people.small_recording(person), out, workers=2)
    return out


@pytest.fixture
def copy(folder, tmp_path):
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def _files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_the_same_settings_write_the_same_bytes(folder, person, tmp_path):
    record(synthetic_people.small_recording(person), tmp_path / "again", workers=1)
    assert _files(tmp_path / "again") == _files(folder)


def test_a_recording_that_was_cut_off_goes_on(folder, person, tmp_path, monkeypatch):
    write, written = recording._write_png, []

    def fails(path, values):
        if len(written) == 12:
            raise OSError("the disk is full")
        written.append(path)
        write(path, values)

    monkeypatch.setattr(recording, "_write_png", fails)
    with pytest.raises(OSError, match="full"):
        record(synthetic_people.small_recording(person), tmp_path / "cut", workers=1)
    with pytest.raises(CaptureError):
        open_capture(tmp_path / "cut")
    monkeypatch.setattr(recording, "_write_png", write)
    record(synthetic_people.small_recording(person), tmp_path / "cut", workers=1)
    assert _files(tmp_path / "cut") == _files(folder)


def test_another_seed_writes_other_frames(folder, person, tmp_path):
    record(
        synthetic_people.small_recording(person, seed=4, frames=2, cameras=1),
        tmp_path / "other",
        workers=1,
    )
    first, other = open_capture(folder), open_capture(tmp_path / "other")
    assert not np.allclose(first.world_from_head(0), other.world_from_head(0))


def test_reader_gives_what_was_recorded(folder):
    capture = open_capture(folder)
    assert (capture.kind, capture.num_frames, capture.fps) == ("synthetic", 11, 25.0)
    assert capture.split.test == (10,)
    assert len(capture.cameras) == 3
    sound = capture.audio()
    assert sound.rate == 16000 and len(sound.samples) == 11 * 640
    assert capture.head_points().shape == (6000, 3)
    assert capture.eyes(0).shape == (7,)
    assert capture.blendshapes(0).shape == (len(capture.blendshape_names),)
    assert "espeak-ng" in str(capture.provenance["sources"])
    for frame in range(11):
        seen = [c for c in range(3) if capture.image(c, frame) is not None]
        assert len(seen) == 1
        pose = capture.world_from_head(frame)
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_outside_the_mask_the_picture_is_the_background(folder):
    capture = open_capture(folder)
    camera = next(c for c in range(3) if capture.image(c, 0) is not None)
    mask = capture.mask(camera, 0)
    outside = mask == 0
    assert 0.2 < mask.mean() < 0.9 and outside.any()
    image, background = capture.image(camera, 0), capture.background(camera)
    np.testing.assert_array_equal(image[outside], background[outside])


def _block_face(weights):
    """(81, 3) of the block head's face in closed form, by the weights of its shapes.

    Its origin is as high as the eyes and as far back as the head's joint.
    """
    across, up = np.linspace(-1, 1, 9)[np.arange(81) % 9], np.linspace(-1, 1, 9)[np.arange(81) // 9]
    face = np.stack([0.08 * across, 0.12 * up, 0.07 - 0.04 * across**2], 1)
    face[:18, 1] -= 0.03 * weights["jawOpen"]  # the two lowest rows
    face[10, 1] -= 0.03 * weights["eyeBlinkLeft"]
    face[11, 1] -= 0.03 * weights["eyeBlinkRight"]
    face[12:14, 1] -= 0.03 * weights["browInnerUp"]  # a vertex on either side
    return face


def test_landmarks_are_the_projected_vertices(folder):
    capture, lowest = open_capture(folder), []
    for frame in (0, 7):
        values = capture.blendshapes(frame).astype(float)
        face = _block_face(dict(zip(capture.blendshape_names, values, strict=True)))
        landmarks = face[np.arange(68)]
        landmarks[[61, 62, 63]], landmarks[[65, 66, 67]] = face[22], face[13]  # the lips
        lowest.append(landmarks[66, 1])
        pose = capture.world_from_head(frame)
        world = landmarks @ pose[:3, :3].T + pose[:3, 3]
        for index, camera in enumerate(capture.cameras):
            turned, shift = camera.world_to_camera[:3, :3], camera.world_to_camera[:3, 3]
            x, y, z = camera.intrinsics @ (world @ turned.T + shift).T
            expected = np.stack([x / z, y / z], 1)
            np.testing.assert_allclose(capture.landmarks(index, frame), expected, atol=1e-3)
    assert abs(lowest[0] - lowest[1]) > 1e-4  # the mouth moves


def test_views_are_shared_out_evenly():
    views = choose_views(90, 6, 2, seed=1)
    assert (views.sum(axis=1) == 2).all()
    assert (views.sum(axis=0) == 30).all()
    assert (choose_views(90, 6, 2, seed=1) == views).all()


def test_points_lie_on_the_surface(person):
    subject = load_subject(str(person))
    points = surface_points(subject, 500, seed=0).on(subject.vertices)
    face = points[points[:, 1] > -0.11]
    face = face[np.abs(face[:, 0]) < 0.02]
    assert len(face) > 10
    assert (np.abs(face[:, 2] - (0.1 - 0.03)) < 0.02).all()


@pytest.mark.parametrize(
    ("name", "words"),
    [("capture.json", "capture.json"), ("frames.safetensors", "frames.safetensors")],
)
def test_a_damaged_file_is_named(copy, name, words):
    (copy / name).write_bytes((copy / name).read_bytes()[:20])
    with pytest.raises(CaptureError, match=words):
        open_capture(copy)


def test_a_missing_picture_is_named_with_its_frame(copy):
    capture = open_capture(copy)
    camera = next(c for c in range(3) if capture.image(c, 4) is not None)
    (copy / "images" / str(camera) / "000004.png").unlink()
    with pytest.raises(CaptureError, match=rf"frame 4 of camera {camera}"):
        capture.image(camera, 4)


def test_a_wrong_count_of_frames_is_told(copy):
    about = json.loads((copy / "capture.json").read_text())
    about["num_frames"] = 12
    (copy / "capture.json").write_text(json.dumps(about))
    with pytest.raises(CaptureError, match="must have shape"):
        open_capture(copy)


def test_sound_missing_is_told(copy):
    (copy / "audio.wav").unlink()
    with pytest.raises(CaptureError, match=r"audio\.wav"):
        open_capture(copy).audio()


@pytest.mark.parametrize("changes", [{"views_per_frame": 4}, {"frames": 0}, {"rig": "dome"}])
def test_settings_that_make_no_sense_are_refused(person, tmp_path, changes):
    with pytest.raises(SettingsError):
        record(synthetic_people.small_recording(person, **changes), tmp_path / "x", workers=1)
    assert not (tmp_path / "x").exists()


def test_a_full_folder_is_not_overwritten(folder, person):
    before = _files(folder)
    with pytest.raises(SettingsError, match="holds something"):
        record(synthetic_people.small_recording(person), folder, workers=1)
    assert _files(folder) == before


def test_subject_files_that_lack_an_array_are_told(tmp_path):
    path = synthetic_people.write_person(tmp_path / "bad.npz", lip_mask=None)
    with pytest.raises(CaptureError, match="lip_mask"):
        load_subject(str(path))
    with pytest.raises(CaptureError, match="no subject file"):
        load_subject(str(tmp_path / "none.npz"))


@pytest.mark.skipif(not SUBJECTS.is_dir(), reason="the shared subjects are not here")
@pytest.mark.parametrize("name", ["human_face_f", "human_face_m"])
def test_shared_subjects_close_and_open_their_lips(name):
    subject = load_subject(str(SUBJECTS / f"{name}.npz"))
    gaps = {}
    for viseme in ("PP", "aa"):
        marks = subject.landmarks(subject.posed(subject.visemes[viseme]))
        gaps[viseme] = np.linalg.norm(marks[62] - marks[66])
    assert gaps["PP"] < 0.002 and gaps["aa"] > 0.012


@needs("anny")
def test_anny_closes_and_opens_the_lips():
    subject = load_subject("anny")
    gaps = {}
    for viseme in ("sil", "PP", "aa"):
        marks = subject.landmarks(subject.posed(subject.visemes[viseme]))
        gaps[viseme] = np.linalg.norm(marks[62] - marks[66])
    assert gaps["PP"] < 0.002 and gaps["sil"] < 0.002 and gaps["aa"] > 0.012
    marks = subject.landmarks(subject.vertices)
    assert marks[16, 0] > 0.05 > -0.05 > marks[0, 0]  # the person's left is +X
    np.testing.assert_allclose(marks[36:42].mean(0)[1], 0, atol=0.01)  # eyes at the origin's height
