"""Foreign recordings that claim more than they hold."""

import struct
import time
import tracemalloc

import pytest
from PIL import Image

from ico3d.capture.importing import colmap
from ico3d.capture.importing.colmap import MOST_POINTS
from ico3d.capture.importing.foreign import inside
from ico3d.capture.importing.recording import import_recording
from ico3d.capture.importing.settings import ImportSettings
from ico3d.capture.writing import new_folder
from ico3d.common.unpacking import memory
from ico3d.errors import CaptureError
from support.recordings import foreign_models


@pytest.mark.parametrize("mine", [0, 30])
def test_a_binary_table_of_colmap_that_claims_much_is_not_kept(tmp_path, monkeypatch, mine):
    """A hole of a file: a disk holds it in no bytes."""
    root = foreign_models.write_colmap(tmp_path, foreign_models.poses(2), "OPENCV", True)
    with (root / "sparse/0/points3D.bin").open("r+b") as file:
        file.write(struct.pack("<Q", MOST_POINTS + 1))
        file.truncate(mine << 20)
    if mine:
        monkeypatch.setattr(memory, "free_memory", lambda: 80 << 20)
    sentence = "the free memory is enough for" if mine else "damaged or cut off"
    with pytest.raises(CaptureError, match=sentence):
        import_recording(root, tmp_path / "out", ImportSettings())
    if mine:
        monkeypatch.undo()
        with pytest.raises(CaptureError, match=f"states {MOST_POINTS + 1} points"):
            import_recording(root, tmp_path / "out", ImportSettings())


def test_a_name_of_a_million_folders_is_refused_at_once(tmp_path):
    """To resolve it would take the square of its parts."""
    begun = time.process_time()
    with pytest.raises(CaptureError, match="no picture has a name of 2000005 letters"):
        inside(tmp_path, "a/" * 1_000_000 + "b.png", "images.txt")
    assert time.process_time() - begun < 1


def test_a_table_of_colmap_that_claims_much_is_not_kept(tmp_path):
    root = foreign_models.write_colmap(tmp_path, foreign_models.poses(2), "OPENCV", False)
    with (root / "sparse/0/points3D.txt").open("r+b") as file:
        file.truncate(1 << 30)  # of which the disk holds nothing
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError, match="damaged or cut off"):
            import_recording(root, tmp_path / "out", ImportSettings())
        assert tracemalloc.get_traced_memory()[1] < 200 << 20
    finally:
        tracemalloc.stop()


def test_a_table_of_points_becomes_numbers_line_by_line(tmp_path):
    """Words of all lines took fifty times as much as the file."""
    file = tmp_path / "points3D.txt"
    file.write_text("1 22 33 44\n" * 100_000)
    tracemalloc.start()
    try:
        assert colmap._text_points(file).shape == (100_000, 3)
        assert tracemalloc.get_traced_memory()[1] < 4 << 20
    finally:
        tracemalloc.stop()


def test_a_long_line_of_a_table_is_not_taken_apart(tmp_path):
    file = tmp_path / "cameras.txt"
    file.write_text("1 PINHOLE 9 9" + " 1" * 1_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="could not convert"):
            colmap._text_cameras(file)
        assert tracemalloc.get_traced_memory()[1] < 30 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("line", ["a", "1 2 3"])
def test_lines_of_few_words_are_not_kept(tmp_path, line):
    root = foreign_models.write_colmap(tmp_path, foreign_models.poses(2), "OPENCV", False)
    (root / "sparse/0/points3D.txt").write_text(f"{line}\n" * 100_000)
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError, match="damaged or cut off"):
            import_recording(root, tmp_path / "out", ImportSettings())
        assert tracemalloc.get_traced_memory()[1] < 4 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("what", ["CAMERAS", "POINTS"])
def test_a_model_of_too_many_cameras_or_points_is_refused(tmp_path, monkeypatch, what, binary):
    root = foreign_models.write_colmap(tmp_path, foreign_models.poses(2), "OPENCV", binary)
    monkeypatch.setattr(colmap, f"MOST_{what}", 0)
    with pytest.raises(CaptureError, match=rf"states \d+ {what.lower()}: at most 0 are read"):
        import_recording(root, tmp_path / "out", ImportSettings())


@pytest.mark.parametrize("key", ["file_path", "mask_path"])
def test_a_picture_that_goes_on_as_a_hole_is_not_copied(tmp_path, key):
    names = ["a.png", "b.png", "c.png"]
    foreign_models.write_pictures(tmp_path, names)
    Image.new("L", (40, 32), 255).save(tmp_path / "mask.png")
    entries = foreign_models.frames(foreign_models.poses(3), names)
    entries[1]["mask_path"] = "mask.png"
    foreign_models.write_transforms(tmp_path, entries)
    with (tmp_path / entries[1][key]).open("r+b") as file:
        file.truncate(1 << 33)
    with pytest.raises(CaptureError, match="has holes, which no picture has"):
        import_recording(tmp_path, tmp_path / "out", ImportSettings())
    assert not (tmp_path / "out").exists()


def test_a_recording_that_does_not_fit_is_refused_before_it_is_copied(tmp_path, monkeypatch):
    foreign_models.write_pictures(tmp_path, ["a.png"])
    foreign_models.write_transforms(
        tmp_path, foreign_models.frames(foreign_models.poses(1), ["a.png"])
    )
    usage = new_folder.shutil.disk_usage(tmp_path)
    full = usage._replace(free=new_folder.SPARE)
    monkeypatch.setattr(new_folder.shutil, "disk_usage", lambda _: full)
    with pytest.raises(CaptureError, match=r"which has 0\.3 GB left"):
        import_recording(tmp_path, tmp_path / "out", ImportSettings())
    assert not (tmp_path / "out").exists()
