"""Damaged synthetic captures, as `bench/fuzz` found them: one sentence each."""

import json
import os
import struct
import zlib

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from ico3d.capture import synthetic
from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError
from support.recordings.synthetic_folder import write_synthetic
from support.strangers.claimed import write_crowded


@pytest.fixture
def folder(tmp_path):
    write_synthetic(tmp_path)
    return tmp_path


def fails(call, *words):
    with pytest.raises(CaptureError) as error:
        call()
    assert all(word in str(error.value) for word in words), str(error.value)


def told(folder, **about):
    """Other values in its description."""
    file = folder / "capture.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | about))
    return folder


def test_version_1_is_a_head(folder):
    """Which had no field for what is shown."""
    about = json.loads((folder / "capture.json").read_text()) | {"version": 1}
    del about["shows"]
    (folder / "capture.json").write_text(json.dumps(about))
    capture = open_capture(folder)
    assert capture.shows == "head" and capture.num_frames == 3
    assert capture.image(0, 2).shape == (16, 24, 3) and capture.head_points().shape == (9, 3)


@pytest.mark.parametrize(
    ("about", "word"),
    [
        ({"fps": "fast"}, "fps"),
        ({"num_frames": 1e300}, "num_frames"),
        ({"sources": 1}, "sources"),
        ({"cameras": []}, "cameras"),
        ({"version": 3}, "this reads 1 and 2"),
    ],
)
def test_impossible_values_are_named(folder, about, word):
    fails(lambda: open_capture(told(folder, **about)), "capture.json", word)


def test_brackets_without_end_are_no_description(folder):
    (folder / "capture.json").write_text("[" * 100_000)
    fails(lambda: open_capture(folder), "damaged")


def test_damaged_phonemes_are_named(folder):
    capture = open_capture(told(folder, phonemes=[1]))
    fails(lambda: capture.phonemes, "phonemes")


def test_a_picture_that_claims_to_be_huge_is_refused_undecoded(folder):
    file = folder / "images" / "front" / "000000.png"
    data = bytearray(file.read_bytes())
    struct.pack_into(">I", data, 16, 1 << 30)
    struct.pack_into(">I", data, 29, zlib.crc32(data[12:29]))
    file.write_bytes(data)
    fails(lambda: open_capture(folder).image(0, 0), "000000.png", "larger than is taken")


def test_half_a_sample_is_no_sound(folder):
    file = folder / "audio.wav"
    file.write_bytes(file.read_bytes()[:-1])
    fails(lambda: open_capture(folder).audio(), "audio.wav", "damaged")
    file.unlink()
    os.mkfifo(file)  # whoever opens it waits
    fails(lambda: open_capture(folder).audio(), "audio.wav", "damaged")


def test_frames_of_thousands_of_tensors_are_not_read(folder):
    write_crowded(folder / "frames.safetensors")
    with pytest.raises(CaptureError, match="is missing or damaged"):
        open_capture(folder)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("points", np.full((9, 3), np.nan, np.float16), ("points", "must not be float16")),
        ("views", np.ones((3, 1)), ("views", "must not be float64")),
        ("eyes", np.where(np.arange(3)[:, None] < 2, 0.0, np.full(7, np.nan)), ("row 2", "eyes")),
    ],
)
def test_frames_are_of_the_types_that_recordings_have(folder, name, value, words):
    """Of half floats without a number a list of twenty times their size was made."""
    file = folder / "frames.safetensors"
    save_file(load_file(file) | {name: value}, file)
    fails(lambda: open_capture(folder), *words)


def test_points_are_not_millions(folder, monkeypatch):
    monkeypatch.setattr(synthetic, "MOST_POINTS", 8)
    fails(lambda: open_capture(folder), "more than 8 points")
