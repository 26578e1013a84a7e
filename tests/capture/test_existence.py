"""Which views a recording of each format has is known without decoding a picture."""

import shutil

import h5py
import numpy as np
import pytest
from PIL import Image

from ico3d.capture import decoding
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.multiview import clip
from ico3d.errors import CaptureError
from support.recordings import dna_files, multiview_folders, portrait_folder, renderme_files


def without(file, *paths):
    with h5py.File(file, "r+") as opened:
        for path in paths:
            del opened[path]


def dna(folder):
    main = dna_files.write_recording(folder)
    without(main, "Camera_5mp/1/color/2")
    without(main.with_name(f"{main.stem}_annots.smc"), "Mask/2/mask/0")
    return main


def renderme(folder):
    raw = renderme_files.write_recording(folder)
    without(raw, "Camera/18/color/1")
    return raw


def portrait(folder):
    path = portrait_folder.write_folder(folder / "person")
    (path / "parsing" / "3.png").unlink()
    return path


def pictures(folder):
    path = multiview_folders.write_folder(folder / "rig")
    images = sorted((path / "images").glob("*/*"))
    images[0].unlink()
    with Image.open(images[1]) as opened:
        clear = opened.convert("RGBA")
    images[1].unlink()
    clear.save(images[1].with_suffix(".png"))
    shutil.rmtree(path / "masks", ignore_errors=True)
    mask = path / "masks" / images[2].parent.name / f"{images[2].stem}.png"
    mask.parent.mkdir(parents=True)
    Image.fromarray(np.full(np.asarray(clear).shape[:2], 255, np.uint8)).save(mask)
    return path


def videos(folder):
    path = multiview_folders.write_folder(folder / "rig", frames=12)
    name = sorted((path / "images").iterdir())[0].name
    shutil.rmtree(path / "images" / name)
    multiview_folders.write_video(path / "videos" / f"{name}.mp4", 5, size=multiview_folders.SIZE)
    return path


@pytest.mark.parametrize("write", [dna, renderme, portrait, pictures, videos])
@pytest.mark.parametrize("smaller", [False, True])
def test_it_says_what_reading_would_find(write, smaller, tmp_path, monkeypatch):
    capture = open_capture(write(tmp_path))
    if smaller:
        capture = ResizedCapture(capture, 8)
    views = [(c, f) for c in range(len(capture.cameras)) for f in range(capture.num_frames)]
    read = [(capture.image(*v) is not None, capture.mask(*v) is not None) for v in views]
    with monkeypatch.context() as patch:
        patch.setattr(Image.Image, "load", _decodes)
        patch.setattr(clip.Clip, "picture", _decodes)
        told = [(capture.has_image(*v), capture.has_mask(*v)) for v in views]
    assert told == read
    assert {True, False} <= {found for pair in read for found in pair}


def _decodes(*_):
    raise AssertionError("a picture was decoded")


def test_a_damaged_header_is_one_sentence(tmp_path):
    file = tmp_path / "a.png"
    file.write_bytes(b"no picture")
    with pytest.raises(CaptureError, match=r"^the mask is damaged and cannot be decoded\.$"):
        decoding.has_opacity(file, "the mask")
