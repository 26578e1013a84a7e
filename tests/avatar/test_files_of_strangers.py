"""Files of folders by anybody that are links to devices, or pipes: one sentence, at once."""

import os
from types import SimpleNamespace

import numpy as np
import pytest

from ico3d.avatar.animation.keyframes import read_animation
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.camera_path import read_key_cameras
from ico3d.avatar.recorded import read_cuts
from ico3d.body.model_folder import TrainedBody
from ico3d.bundle.format import read_background
from ico3d.capture.multiview.description import read_json
from ico3d.capture.reading.arrays import LARGEST, read_numbers
from ico3d.capture.synthetic import SyntheticCapture
from ico3d.common.files import MOST_NOTES
from ico3d.errors import CaptureError, Ico3dError
from ico3d.head.model_folder import TrainedHead
from ico3d.scene.model_folder import TrainedScene
from ico3d.splat.files.formats import read_file

BODY = SimpleNamespace(windows=[SimpleNamespace(last=6)], fps=15.0)


def sparse(file):
    with file.open("wb") as opened:
        opened.truncate(MOST_NOTES + 1)


READERS = {
    "cameras.json": lambda folder: read_json(folder / "cameras.json"),
    "points.npy": lambda folder: read_numbers(folder / "points.npy"),
    "capture.json": SyntheticCapture,
    "head.json": TrainedHead.load,
    "body.json": TrainedBody.load,
    "scene.json": TrainedScene.load,
    "avatar.json": TrainedAvatar.load,
    "path.json": lambda folder: read_key_cameras(folder / "path.json", 8, 8),
    "splats.ply": lambda folder: read_file(folder / "splats.ply"),
    "background.ply": lambda folder: read_background(folder / "background.ply"),
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("pipe", [True, False])
def test_what_has_no_end_is_not_read(tmp_path, name, pipe):
    if pipe:
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(Ico3dError):
        READERS[name](tmp_path)


def test_arrays_of_zeros_that_take_no_room_on_a_disk_are_not_read(tmp_path):
    with (tmp_path / "points.npy").open("wb") as file:
        about = {"descr": "<f8", "fortran_order": False, "shape": (LARGEST // 24 + 1, 3)}
        np.lib.format.write_array_header_1_0(file, about)
        file.truncate(file.tell() + 24 * (LARGEST // 24 + 1))
    with pytest.raises(CaptureError, match="more than 64 MiB of numbers"):
        read_numbers(tmp_path / "points.npy")


@pytest.mark.parametrize(
    ("name", "read"), [("clips.toml", read_cuts), ("animation.json", read_animation)]
)
def test_larger_files_than_anybody_writes_are_not_read(tmp_path, name, read):
    sparse(tmp_path / name)
    with pytest.raises(Ico3dError, match="no small file"):
        read(tmp_path, BODY)
