"""Recordings that claim millions of frames of which they have no pictures, in every format."""

import json
import tracemalloc
from pathlib import Path

import h5py
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.vetting.claims import BELIEVED, MOST_GAPS, check_claimed
from ico3d.cli import main
from ico3d.errors import CaptureError
from support.recordings import (
    dna_files,
    multiview_folders,
    portrait_folder,
    renderme_files,
    synthetic_folder,
)

MANY = 9_000_000


def claim(file: Path, frames: int = MANY) -> None:
    """Changes what a description says of the number of frames."""
    about = json.loads(file.read_text()) if file.is_file() else {}
    file.write_text(json.dumps(about | {"num_frames": frames}))


def pictures(folder: Path) -> Path:
    claim(multiview_folders.write_folder(folder, 3) / "cameras.json")
    return folder


def videos(folder: Path) -> Path:
    rig = [multiview_folders.entry(c) for c in multiview_folders.ring(2, (64, 48))]
    for camera in rig:
        multiview_folders.write_video(folder / "videos" / f"{camera['name']}.mp4", 5)
    return multiview_folders.write_cameras(folder, rig, MANY, shows="head")


def portrait(folder: Path) -> Path:
    portrait_folder.write_folder(folder)
    (folder / "au.csv").unlink()
    claim(folder / "ico3d.json")
    return folder


def portrait_of_a_high_number(folder: Path) -> Path:
    ids = [*range(portrait_folder.FRAMES - 1), MANY]
    portrait_folder.write_folder(folder, ids)
    (folder / "au.csv").unlink()
    for kind in ("ori_imgs", "gt_imgs"):
        (folder / kind / "21.jpg").rename(folder / kind / f"{MANY}.jpg")
    (folder / "ori_imgs" / "21.lms").rename(folder / "ori_imgs" / f"{MANY}.lms")
    return folder


def synthetic(folder: Path) -> Path:
    folder.mkdir()
    synthetic_folder.write_synthetic(folder)
    claim(folder / "capture.json")
    return folder


def dna(folder: Path) -> Path:
    path = dna_files.write_recording(folder, dna_files.Rig(cameras=(0, 1, 2)))
    with h5py.File(path, "a") as file:
        file["Camera_5mp"].attrs["num_frame"] = 90_000
    return path


def renderme(folder: Path) -> Path:
    path = renderme_files.write_recording(folder)
    with h5py.File(path, "a") as file:
        file["Camera"].attrs["num_frame"] = 90_000
    return path


@pytest.mark.parametrize(
    "write",
    (pictures, videos, portrait, portrait_of_a_high_number, synthetic, dna, renderme),
    ids=lambda write: write.__name__,
)
def test_they_are_refused_when_they_are_opened(tmp_path: Path, write) -> None:
    path = write(tmp_path / "recording")
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError) as error:
            open_capture(path)
        assert tracemalloc.get_traced_memory()[1] < 20 << 20
    finally:
        tracemalloc.stop()
    said = str(error.value)
    assert said.endswith(".") and "\n" not in said
    assert "claims 9" in said or write is synthetic  # its tables lack the rows


def test_verbs_say_so_in_a_sentence(tmp_path: Path, capsys) -> None:
    folder = str(pictures(tmp_path / "recording"))
    out = str(tmp_path / "out")
    for verb in (["check", folder], ["resize", folder, out, "--height", "16"], ["pose", folder]):
        assert main(["capture", *verb]) == 1
        assert f"claims {MANY} frames and has 9 pictures" in capsys.readouterr().err


def test_recordings_with_gaps_and_of_one_view_a_moment_are_opened(tmp_path: Path) -> None:
    claim(multiview_folders.write_folder(tmp_path, 3) / "cameras.json", BELIEVED)
    assert open_capture(tmp_path).num_frames == BELIEVED
    asked = []

    def one_camera():
        asked.append(1)
        return 1000

    many = (one_camera() for _ in range(60))
    check_claimed(2 * MOST_GAPS * 1000, many, "a recording")
    assert len(asked) == 2  # no more are counted than are needed


def test_sparse_pictures_are_counted_over_all_cameras() -> None:
    check_claimed(24_000, [1000] * 24, "one view a moment")
    with pytest.raises(CaptureError, match="claims 240001 frames and has 24000 pictures"):
        check_claimed(240_001, [1000] * 24, "a recording")
