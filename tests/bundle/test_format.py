"""What a bundle is: round trips, and the listing's checks."""

import json
import os
import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from ico3d.bundle.archive import write_zip
from ico3d.bundle.format import Bundle, write_bundle
from ico3d.common.files import SPARE
from ico3d.errors import BundleError, StorageError
from support.bundles.random_bundle import (
    random_files,
    random_head,
    random_manifest,
    write_random_bundle,
)


def test_a_bundle_reads_back_as_it_was_written(tmp_path):
    head = random_head(50, seed=3)
    files = random_files(head)
    manifest = write_bundle(tmp_path / "a.ico3d", random_manifest(head), files)
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.manifest == manifest
    for name in vars(head):
        np.testing.assert_array_equal(getattr(bundle.head, name), getattr(head, name))
    assert bundle.world_from_head.shape == (manifest.head.num_poses, 4, 4)
    assert bundle.names[0] == "manifest.json" and set(bundle.names[1:]) == set(files)
    assert {name: bundle.read(name) for name in files} == files
    assert json.loads(bundle.read("manifest.json"))["name"] == "random"


def test_the_same_parts_give_the_same_bytes(tmp_path):
    write_random_bundle(tmp_path / "a.ico3d", 50)
    write_random_bundle(tmp_path / "sub" / "b.ico3d", 50)
    assert (tmp_path / "a.ico3d").read_bytes() == (tmp_path / "sub" / "b.ico3d").read_bytes()


def test_a_folder_is_as_good_as_a_zip(bundle_path, bundle_folder):
    assert Bundle.open(bundle_folder).manifest == Bundle.open(bundle_path).manifest


def test_no_file_is_compressed_and_dates_are_fixed(bundle_path):
    with zipfile.ZipFile(bundle_path) as archive:
        for entry in archive.infolist():
            assert entry.compress_type == zipfile.ZIP_STORED
            assert entry.date_time == (1980, 1, 1, 0, 0, 0)


def test_a_failed_write_leaves_the_old_bundle(bundle_path, bundle_bytes):
    head = random_head(50)
    files = random_files(head) | {"../evil": b"x"}
    with pytest.raises(BundleError):
        write_bundle(bundle_path, random_manifest(head), files)
    assert bundle_path.read_bytes() == bundle_bytes
    assert [p.name for p in bundle_path.parent.iterdir()] == [bundle_path.name]


def test_read_knows_only_listed_files(bundle_path):
    bundle = Bundle.open(bundle_path)
    for name in ("head", "../secret", "", "/etc/passwd"):
        with pytest.raises(BundleError, match="has no file"):
            bundle.read(name)


def test_read_notices_a_change_after_opening(bundle_folder):
    bundle = Bundle.open(bundle_folder)
    thumbnail = bundle_folder / "thumbnail.png"
    data = thumbnail.read_bytes()
    thumbnail.write_bytes(data[:-1] + b"!")
    with pytest.raises(BundleError, match=r"thumbnail\.png.*hash"):
        bundle.read("thumbnail.png")
    thumbnail.write_bytes(data * 2)
    with pytest.raises(BundleError, match=r"thumbnail\.png"):
        bundle.read("thumbnail.png")


def test_what_is_put_in_the_place_of_an_open_bundle_is_not_read(bundle_path, tmp_path):
    """Servers that share a bundle are updated one after another; nobody has checked the new one."""
    bundle = Bundle.open(bundle_path)
    before = bundle.read("thumbnail.png")
    other = tmp_path / "other.zip"
    with zipfile.ZipFile(other, "w") as archive:
        for number in range(3000):
            archive.writestr(f"thumbnail.png{number}", b"")
    other.replace(bundle_path)
    assert bundle.read("thumbnail.png") == before
    with pytest.raises(BundleError, match="holds more than 256 files"):
        Bundle.open(bundle_path)


def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(bundle_folder):
    bundle = Bundle.open(bundle_folder)
    (bundle_folder / "thumbnail.png").unlink()
    os.mkfifo(bundle_folder / "thumbnail.png")
    with pytest.raises(BundleError, match=r"thumbnail\.png"):
        bundle.read("thumbnail.png")


@pytest.mark.parametrize(
    "name", ["head.safetensors", "head_poses.safetensors", "speech.onnx", "thumbnail.png"]
)
def test_a_missing_file_is_named(bundle_folder, name):
    (bundle_folder / name).unlink()
    with pytest.raises(BundleError, match=name):
        Bundle.open(bundle_folder)


def test_an_unlisted_file_is_named(bundle_folder):
    (bundle_folder / "extra.bin").write_bytes(b"x")
    with pytest.raises(BundleError, match=r"extra\.bin: is not listed"):
        Bundle.open(bundle_folder)


def test_a_wrong_hash_is_named(bundle_folder):
    path = bundle_folder / "speech.onnx"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(BundleError, match=r"speech\.onnx.*hash"):
        Bundle.open(bundle_folder)


def test_only_files_that_belong_there_are_written(tmp_path):
    head = random_head(50)
    with pytest.raises(BundleError, match=r"payload\.bin: does not belong"):
        files = random_files(head) | {"payload.bin": b"x"}
        write_bundle(tmp_path / "a.ico3d", random_manifest(head), files)


def test_a_head_without_speech_needs_no_graph(tmp_path):
    head = random_head(50)
    manifest = random_manifest(head)
    info = replace(manifest.head, inputs="blendshapes", eye_offset=None)
    files = random_files(head)
    del files["speech.onnx"]
    path = tmp_path / "a.ico3d"
    write_bundle(path, replace(manifest, head=info, speech=None), files)
    assert Bundle.open(path).manifest.speech is None


@pytest.mark.parametrize("size", [(513, 10), (10, 513)])
def test_a_large_thumbnail_is_refused(tmp_path, size):
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.new("RGB", size).save(buffer, "PNG")
    head = random_head(50)
    files = random_files(head) | {"thumbnail.png": buffer.getvalue()}
    write_bundle(tmp_path / "a.ico3d", random_manifest(head), files)
    with pytest.raises(BundleError, match=r"thumbnail\.png"):
        Bundle.open(tmp_path / "a.ico3d")


def test_there_must_be_a_bundle(tmp_path):
    with pytest.raises(BundleError, match="there is no bundle"):
        Bundle.open(tmp_path / "nothing.ico3d")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("folder", "folder is a folder or a device: name a file to write."),
        ("pipe", "pipe is a folder or a device: name a file to write."),
        ("file/a.ico3d", "a.ico3d cannot be written: "),
        ("n" * 300, "cannot be written: File name too long."),
    ],
)
def test_where_no_file_can_be_written_is_one_sentence(tmp_path, name, said):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_bytes(b"kept")
    head = random_head(50)
    with pytest.raises(BundleError, match=re.escape(said)):
        write_bundle(tmp_path / name, random_manifest(head), random_files(head))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder", "pipe"]
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "file").read_bytes() == b"kept"


def test_a_bundle_leaves_room_on_the_disk(tmp_path, monkeypatch):
    usage, path = shutil.disk_usage(tmp_path), tmp_path / "a.ico3d"
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=SPARE + 9))
    write_zip(path, {"manifest.json": bytes(9)})
    with pytest.raises(StorageError, match=r"a\.ico3d cannot be written, as the disk is full"):
        write_zip(path, {"manifest.json": bytes(10)})
    with zipfile.ZipFile(path) as archive:
        assert archive.read("manifest.json") == bytes(9)
