"""`ico3d capture track` on recordings of synthetic people, whose heads are known exactly."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.headpose.track_file import NAME, read_track
from ico3d.capture.importing.resizing import resize_capture
from ico3d.cli import main
from ico3d.studio import studio
from ico3d.studio.picture import paint
from ico3d.studio.recording import Recording, record
from support.needs import needs, skip_without
from support.recordings import multiview_folders
from support.shared import MODELS, SUBJECTS

pytestmark = [pytest.mark.slow, needs("mediapipe")]
PERSON = SUBJECTS / "human_face_f.npz"


@pytest.fixture(scope="module", autouse=True)
def model():
    if not (MODELS / "face_landmarker.task").is_file():
        pytest.skip("face_landmarker.task is not here: set ICO3D_MODELS")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(MODELS))
        # Light from few directions, and one sample to a pixel: drawn sooner, and harder to track.
        patch.setattr(paint, "DIRECTIONS", 6)
        patch.setattr(studio, "SUPERSAMPLING", 1)
        yield


def _recorded(folder: Path, **settings) -> tuple[Capture, Path]:
    """A synthetic capture, and the same without what is known about the head."""
    values = dict(text="", lively=True, light="studio", motion="talk", seed=0)
    record(Recording(**values | settings), folder / "truth", 2)
    resize_capture(folder / "truth", folder / "recording", settings["size"], 2)
    assert open_capture(folder / "recording").world_from_head(0) is None
    return open_capture(folder / "truth"), folder / "recording"


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    skip_without("anny")
    shape = dict(subject="anny", rig="head", cameras=5, views_per_frame=5)
    folder = tmp_path_factory.mktemp("head")
    return _recorded(folder, frames=3, fps=5.0, size=192, **shape)


def _agreement(truth: Capture, found: Capture) -> tuple[np.ndarray, np.ndarray]:
    """Degrees and metres (F,) by which poses differ, but for the choice of canonical space."""
    frames = range(truth.num_frames)
    true, mine = (np.stack([c.world_from_head(f) for f in frames]) for c in (truth, found))
    between = np.linalg.inv(mine) @ true
    space = np.eye(4)  # one and the same for all frames
    space[:3, :3] = Rotation.from_matrix(between[:, :3, :3]).mean().as_matrix()
    space[:3, 3] = between[:, :3, 3].mean(0)
    placed = mine @ space
    turned = Rotation.from_matrix(placed[:, :3, :3].transpose(0, 2, 1) @ true[:, :3, :3])
    away = np.linalg.norm(placed[:, :3, 3] - true[:, :3, 3], axis=1)
    return np.degrees(turned.magnitude()), away


def test_the_head_of_a_bust_moves_as_it_did(head, tmp_path, capsys):
    truth, folder = head
    sheet = tmp_path / "sheet.jpg"
    assert main(["capture", "track", str(folder), "--check", str(sheet)]) == 0
    assert "3 of 3 frames tracked by" in capsys.readouterr().err
    found = open_capture(folder)
    degrees, metres = _agreement(truth, found)
    assert degrees.max() < 2.0 and metres.max() < 0.005
    eyes = [36, 39, 42, 45]  # corners: where the landmarks of all models agree
    for frame in range(3):
        pose, other = truth.world_from_head(frame), found.world_from_head(frame)
        true = truth.landmarks_3d(frame)[eyes] @ pose[:3, :3].T + pose[:3, 3]
        mine = found.landmarks_3d(frame)[eyes] @ other[:3, :3].T + other[:3, 3]
        assert np.linalg.norm(mine - true, axis=1).max() < 0.008
    # Canonical space: the person's left is +x, up +y, and the nose points to +z.
    marks = found.landmarks_3d(0)
    assert marks[45, 0] > 0.02 > -0.02 > marks[36, 0] and marks[27, 1] > marks[8, 1] + 0.05
    assert marks[30, 2] > marks[[0, 16], 2].max() + 0.04
    with Image.open(sheet) as drawn:
        assert drawn.size == (4 * 384, 3 * 384)
        assert (np.asarray(drawn)[:384, :384] > (200, 180, 0)).all(-1).sum() > 300


def test_a_frame_without_pictures_is_interpolated(head, tmp_path, capsys):
    truth, folder = head
    copy = shutil.copytree(folder, tmp_path / "gap", ignore=shutil.ignore_patterns(NAME))
    for camera in range(4):  # one camera alone does not tell where a head is
        (copy / "images" / str(camera) / "000001.jpg").unlink()
    assert main(["capture", "track", str(copy), "--workers", "1"]) == 0
    assert "frames 1 are interpolated" in capsys.readouterr().err
    assert read_track(copy, 3, 5).gaps == [(1, 1)]
    degrees, metres = _agreement(truth, open_capture(copy))
    assert np.delete(degrees, 1).max() < 2.5 and metres.max() < 0.02


def test_small_faces_in_pictures_of_a_whole_person_are_found(tmp_path):
    if not PERSON.is_file():
        pytest.skip("../shared/subjects is not here")
    # Of five, those beside the one in front stand at 72°: they see a profile behind locks of hair.
    shape = dict(subject=str(PERSON), rig="body", cameras=6, views_per_frame=6)
    truth, folder = _recorded(tmp_path, frames=2, fps=15.0, size=704, **shape)
    assert main(["capture", "track", str(folder)]) == 0
    degrees, metres = _agreement(truth, open_capture(folder))
    assert degrees.max() < 2.0 and metres.max() < 0.005


@pytest.mark.parametrize(
    ("cameras", "message"),
    [(3, "no frame shows a face to two cameras at least"), (1, "has one camera")],
)
def test_what_cannot_be_tracked_is_one_sentence(tmp_path, capsys, cameras, message):
    folder = multiview_folders.write_folder(tmp_path / "noise", cameras, frames=1)
    assert main(["capture", "track", str(folder)]) == 1
    error = capsys.readouterr().err
    assert message in error and error.strip().count("\n") <= 1
    assert not (folder / NAME).exists()


def test_cameras_in_wrong_places_are_told_from_faces_that_are_not_there(head, tmp_path, capsys):
    _, folder = head
    copy = shutil.copytree(folder, tmp_path / "wrong", ignore=shutil.ignore_patterns(NAME))
    about = json.loads((copy / "cameras.json").read_text())
    about["num_frames"] = 1
    for index, camera in enumerate(about["cameras"]):
        camera["world_to_camera"][1][3] += 0.1 * index
    (copy / "cameras.json").write_text(json.dumps(about))
    assert main(["capture", "track", str(copy)]) == 1
    assert "no two agree on where one is" in capsys.readouterr().err


def test_captures_of_other_formats_are_tracked_as_they_are(head, tmp_path):
    """One by our own studio: its true head gives way to the one that was found."""
    truth, _ = head
    copy = shutil.copytree(truth.path, tmp_path / "copy")
    assert main(["capture", "track", str(copy)]) == 0
    found = open_capture(copy)
    assert found.kind == "synthetic" and (copy / NAME).is_file()
    degrees, metres = _agreement(truth, found)
    assert 0 < degrees.max() < 2.0 and 0 < metres.max() < 0.005


def test_the_name_of_the_sheet_is_looked_at_first(head, capsys):
    _, folder = head
    assert main(["capture", "track", str(folder), "--check", "sheet.pdf"]) == 1
    assert "name the contact sheet .jpg or .png" in capsys.readouterr().err
