import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import load_file, save_file

from ico3d.capture.checking import head
from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.cli import main
from support.recordings import portrait_folder
from support.recordings.synthetic_folder import write_synthetic


def _levels(folder):
    return {finding.what: finding for finding in examine(open_capture(folder))}


def test_a_sound_capture_has_no_errors_and_a_contact_sheet(folder, capsys):
    assert main(["capture", "check", str(folder)]) == 0
    assert "landmarks" in capsys.readouterr().out
    with Image.open(folder / "check.png") as sheet:
        assert sheet.size == (6 * 256, 3 * 256 + 96)


def test_steady_landmarks_of_a_rigid_head_fit_exactly(folder):
    assert "within 0.0" in _levels(folder)["landmarks"].text


def test_landmarks_of_the_next_frame_are_noticed(folder, capsys):
    poses = portrait_folder.head_poses()
    for frame in range(portrait_folder.FRAMES - 1):
        pixels = portrait_folder.project(poses[frame + 1], portrait_folder.head_points())
        np.savetxt(folder / "ori_imgs" / f"{frame}.lms", pixels)
    finding = _levels(folder)["landmarks"]
    assert finding.level == "error" and "-1 frame" in finding.text
    assert main(["capture", "check", str(folder)]) == 1
    errors = capsys.readouterr().err
    assert errors.startswith("ico3d: ") and "landmarks" in errors


def test_empty_mask_is_an_error(folder):
    for file in (folder / "parsing").iterdir():
        Image.fromarray(np.full((64, 64, 3), 255, np.uint8)).save(file)
    assert _levels(folder)["masks"].level == "error"


def test_a_recording_without_a_picture_is_told(tmp_path):
    write_synthetic(tmp_path)
    file = tmp_path / "frames.safetensors"
    frames = load_file(file)
    save_file(frames | {"views": np.zeros_like(frames["views"])}, file)
    assert _levels(tmp_path)["masks"].text == "there is no picture"


def test_damaged_picture_is_named(folder):
    for folder_name in ("gt_imgs", "ori_imgs"):
        (folder / folder_name / "4.jpg").write_bytes(b"\xff\xd8\xff broken")
    finding = _levels(folder)["pictures"]
    assert finding.level == "error" and "4.jpg" in finding.text


def test_sound_of_another_length_is_a_warning(folder):
    from scipy.io import wavfile

    tone = (9000 * np.sin(np.arange(40_000) / 9)).astype(np.int16)
    wavfile.write(folder / "aud.wav", 16_000, tone)
    finding = _levels(folder)["sound"]
    assert finding.level == "warn" and finding.text.startswith("2.50 s for 0.88 s")


def test_no_capture_is_one_sentence(tmp_path, capsys):
    assert main(["capture", "check", str(tmp_path / "none")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("pixels", "level"), [(0.02, "ok"), (2.0, "error")])
def test_poses_of_another_frame_matter_where_pixels_do(folder, monkeypatch, pixels, level):
    """A head that hardly moves is nowhere blurred by a pose of its neighbour."""
    errors = {0: 2 * pixels, -1: 0.5 * pixels, 1: 3 * pixels}
    monkeypatch.setattr(head, "_rigid_errors", lambda _, shift: np.full(9, errors[shift]))
    assert head.landmarks(open_capture(folder)).level == level
