"""Damaged and incomplete recordings: known ones are read, others are one sentence."""

import logging
import os
import shutil
import tracemalloc

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.capture.smc.file import SmcFile
from ico3d.cli import main as run
from ico3d.errors import CaptureError, MissingExtraError
from support.recordings import dna_files


def fails(call, *words):
    with pytest.raises(CaptureError) as error:
        call()
    message = str(error.value)
    assert all(word in message for word in words), message
    assert "\n" not in message and message[-1] in ".?"


def annotations_of(main):
    return main.with_stem(f"{main.stem}_annots")


@pytest.fixture
def main(tmp_path):
    """A recording of four cameras and three frames."""
    return dna_files.write_recording(tmp_path, dna_files.Rig(cameras=(0, 1, 2, 48)))


def test_forty_rows_of_expressions_for_more_frames(tmp_path, caplog):
    rig = dna_files.Rig(cameras=(0, 1), frames=45, sizes=((8, 8), (8, 8)), expression_rows=40)
    capture = open_capture(dna_files.write_recording(tmp_path, rig))
    parts = dna_files.smplx(45)
    with caplog.at_level(logging.WARNING):
        for frame in (39, 40, 44):
            fit = capture.smplx(frame)
            np.testing.assert_array_equal(fit.expression, parts["expression"][39])
            np.testing.assert_array_equal(fit.fullpose, parts["fullpose"][frame])
    (said,) = caplog.messages
    assert "expression have 40 rows for 45 frames" in said


def test_one_row_of_betas(tmp_path, caplog):
    capture = open_capture(
        dna_files.write_recording(tmp_path, dna_files.Rig(cameras=(0, 1), betas_rows=1))
    )
    with caplog.at_level(logging.WARNING):
        for frame in range(3):
            betas = capture.smplx(frame).betas
            np.testing.assert_array_equal(betas, dna_files.smplx(3)["betas"][0])
    (said,) = caplog.messages
    assert "betas have 1 rows for 3 frames" in said


def test_poses_that_end_early_are_none(main, caplog):
    with h5py.File(annotations_of(main), "a") as file:
        poses = file["SMPLx/fullpose"][:2]
        del file["SMPLx/fullpose"]
        file["SMPLx/fullpose"] = poses
    capture = open_capture(main)
    assert capture.smplx(1) is not None and capture.smplx(2) is None
    assert "only the first 2 of 3 frames" in caplog.messages[0]


def test_parts_without_annotations(tmp_path):
    rig = dna_files.Rig(cameras=(0, 1, 2), annotated=False)
    capture = open_capture(dna_files.write_recording(tmp_path, rig))
    assert capture.image(0, 0) is not None
    assert capture.mask(0, 0) is None and capture.smplx(0) is None
    assert capture.keypoints_2d(0, 0) is None and capture.keypoints_3d(0) is None
    levels = {f.what: f.level for f in examine(capture)}
    assert levels["views"] == "ok" and levels["SMPL-X"] == "warn" and levels["masks"] == "warn"


def test_a_sound_recording_is_checked_without_errors(main, capsys):
    assert run(["capture", "check", str(main)]) == 0
    said = capsys.readouterr().out
    assert "all 12 are there" in said and main.with_suffix(".png").is_file()


def test_missing_frames_are_named(main):
    with h5py.File(main, "a") as file:
        del file["Camera_5mp/1/color/2"]
        del file["Camera_12mp/48/color/0"]
    capture = open_capture(main)
    assert capture.image(1, 2) is None and capture.image(1, 1) is not None
    (finding,) = (f for f in examine(capture) if f.what == "views")
    assert finding.level == "warn"
    assert finding.text == "missing: camera 01, frame 2 (and 1 more)"


def test_damaged_frames_are_named(main, capsys):
    with h5py.File(main, "a") as file:
        del file["Camera_5mp/2/color/1"]
        file["Camera_5mp/2/color/1"] = np.zeros(50, np.uint8)
        whole = file["Camera_5mp/0/color/2"][()]
        del file["Camera_5mp/0/color/2"]
        file["Camera_5mp/0/color/2"] = whole[: len(whole) // 2]
    capture = open_capture(main)
    (finding,) = (f for f in examine(capture) if f.what == "views")
    assert finding.level == "error" and finding.text == "damaged: camera 02, frame 1"
    fails(lambda: capture.image(2, 1), "camera 02, frame 1", "damaged")
    fails(lambda: capture.image(0, 2), "camera 00, frame 2", "damaged")
    assert run(["capture", "check", str(main)]) == 1
    assert "camera" in capsys.readouterr().err


def test_pictures_of_another_size_are_refused(main):
    with h5py.File(main, "a") as file:
        del file["Camera_5mp/2/color/1"]
        file["Camera_5mp/2/color/1"] = dna_files.encoded(dna_files.picture(2, 1, (20, 30)), "JPEG")
    capture = open_capture(main)
    fails(lambda: capture.image(2, 1), "camera 02, frame 1", "30x20", "40x48")


def test_cameras_without_calibration_are_left_out(main, caplog):
    with h5py.File(annotations_of(main), "a") as file:
        del file["Camera_Parameter/01"]
    assert [c.name for c in open_capture(main).cameras] == ["00", "02", "48"]
    assert "01" in caplog.messages[0]


@pytest.mark.parametrize(
    ("part", "value", "words"),
    (
        ("RT", np.eye(4) * 2, "rotation"),
        ("RT", np.eye(3), "shape"),
        ("K", np.full((3, 3), np.nan), "finite"),
        ("K", np.zeros((3, 3)), "focal"),
        ("D", np.array([1e9, 0, 0, 0, 0]), "distortion"),
        ("D", np.zeros(3), "shape"),
        ("Color_Calibration", np.full((3, 3), np.inf), "finite"),
    ),
)
def test_damaged_calibrations_are_named(main, part, value, words):
    with h5py.File(annotations_of(main), "a") as file:
        del file[f"Camera_Parameter/02/{part}"]
        file[f"Camera_Parameter/02/{part}"] = value
    fails(lambda: open_capture(main), "02", words)


def test_annotations_must_be_there(main):
    annotations_of(main).unlink()
    fails(lambda: open_capture(main), "0012_11_annots.smc", "beside it")
    shutil.copy(main, annotations_of(main))
    fails(lambda: open_capture(annotations_of(main)), "main file")


def test_a_folder_of_several_recordings_needs_a_choice(main):
    other = dna_files.write_recording(main.parent, dna_files.Rig(cameras=(0, 1)), "0013_01")
    fails(lambda: open_capture(main.parent), "2 recordings", "0012_11.smc, 0013_01.smc")
    assert open_capture(other).num_frames == 3


def test_other_smc_files_are_told_apart(main):
    with h5py.File(main, "w") as file:
        file.create_group("Camera/00/color")
    fails(lambda: open_capture(main), "DNA-Rendering")


def test_frames_outside_the_recording(main):
    capture = open_capture(main)
    for frame in (-1, 3):
        fails(lambda frame=frame: capture.image(0, frame), "frames 0 to 2")


def test_links_never_lead_into_other_files(main, tmp_path):
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.zeros(9, np.uint8)
    with h5py.File(main, "a") as file:
        del file["Camera_5mp/0/color/1"]
        file["Camera_5mp/0/color/1"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "x")
    capture = open_capture(main)
    fails(lambda: capture.image(0, 1), "Camera_5mp/0/color/1", "damaged")


def test_tables_of_numbers_that_were_never_written_are_refused_unread(main):
    """They take no bytes of the file, and eight in memory for each number."""
    rows = (1 << 28) // 165
    with h5py.File(annotations_of(main), "a") as file:
        del file["SMPLx/fullpose"]
        file.create_dataset("SMPLx/fullpose", (rows, 55, 3), "u1", chunks=(4096, 55, 3))
    tracemalloc.start()
    capture = open_capture(main)
    fails(lambda: capture.smplx(0), f"SMPLx/fullpose has shape ({rows}, 55, 3)", "at most 100000")
    assert tracemalloc.get_traced_memory()[1] < 4 << 20
    tracemalloc.stop()


def test_numbers_are_limited_in_memory_and_in_what_is_unpacked_for_one(main):
    file = SmcFile(main)
    with h5py.File(main, "a") as written:
        written.create_dataset("wide", (9000, 5, 1000), "u1", chunks=(99, 5, 1000))
        written.create_dataset("deep", (4, 4), "u1", maxshape=(None, 4), chunks=(1 << 27, 4))
    fails(lambda: file.numbers("wide", None), "wide", "damaged")
    fails(lambda: file.numbers("deep", (None, 4)), "deep", "damaged")
    fails(lambda: file.head("deep", 4), "deep", "damaged")


def test_a_picture_in_another_file_is_damaged_and_the_other_file_never_opened(main, tmp_path):
    os.mkfifo(tmp_path / "pipe")  # whoever opens it waits
    with h5py.File(main, "a") as file:
        del file["Camera_5mp/0/color/1"]
        outside = [(str(tmp_path / "pipe"), 0, 100)]
        file.create_dataset("Camera_5mp/0/color/1", (100,), "u1", external=outside)
    fails(lambda: open_capture(main).inspect(), "Camera_5mp/0/color/1", "damaged")


def test_names_of_thousands_of_digits_are_no_cameras(main):
    with h5py.File(main, "a") as file:
        file["Camera_5mp"].create_group("9" * 5000)
    assert len(open_capture(main).cameras) == 4


def test_a_missing_package_names_its_extra(main, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"ico3d\[body\]"):
        open_capture(main)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A small recording to be damaged."""
    rig = dna_files.Rig(cameras=(0, 1), frames=1, sizes=((8, 8), (8, 8)))
    return dna_files.write_recording(tmp_path_factory.mktemp("sound"), rig)


def read_everything(path) -> None:
    capture = open_capture(path)
    for camera in range(len(capture.cameras)):
        capture.image(camera, 0), capture.mask(camera, 0), capture.keypoints_2d(camera, 0)
    capture.smplx(0), capture.keypoints_3d(0), capture.inspect()


@settings(max_examples=60)
@given(data=st.data(), which=st.sampled_from(("", "_annots")))
def test_files_cut_anywhere_are_one_sentence(sound, tmp_path_factory, data, which):
    folder = tmp_path_factory.mktemp("cut")
    for suffix in ("", "_annots"):
        shutil.copy(sound.with_stem(sound.stem + suffix), folder)
    file = folder / f"{sound.stem}{which}.smc"
    whole = file.read_bytes()
    file.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    fails(lambda: read_everything(folder / sound.name), file.name)


def test_links_by_name_lead_nowhere_but_into_the_file(tmp_path):
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["inner/n"] = np.array([42.0])
        file["n"] = np.array([42.0])
    with h5py.File(tmp_path / "a.smc", "w") as file:
        file["inner/n"] = np.array([7.0])
        file["out"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/")
        for name, path in (
            ("absolute", "/inner/n"),
            ("relative", "./inner//n"),
            ("twice", "relative"),
            ("inner/beside", "n"),
            ("through", "/out/inner"),
            ("far", "/out/n"),
            ("beyond", "through/n"),
            ("circle", "/circle"),
            ("nothing", "/inner/none"),
        ):
            file[name] = h5py.SoftLink(path)
    opened = SmcFile(tmp_path / "a.smc")
    for name in ("inner/n", "absolute", "relative", "twice", "inner/beside"):
        np.testing.assert_array_equal(opened.numbers(name, (1,)), [7.0])
    for name in ("out", "out/n", "through", "through/n", "far", "beyond", "circle"):
        for read in (opened.keys, opened.holds, opened.shape, opened.encoded):
            fails(lambda name=name, read=read: read(name), name, "damaged")
    assert opened.numbers("nothing", (1,)) is None
