"""Bundles of whole persons, and of what is behind them."""

import gzip
import json
import struct
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ico3d.bundle.backdrop import check_background
from ico3d.bundle.format import Bundle, write_bundle
from ico3d.bundle.manifest import VERSION
from ico3d.errors import BundleError
from support.bundles.random_bundle import random_files, random_head, random_manifest
from support.bundles.random_whole import (
    ANIMATION,
    FRAMES,
    whole_files,
    whole_manifest,
    write_random_whole,
)


def ply(count: int = 2, rows: bytes | None = None, more: str = "", kind: str = "float") -> bytes:
    header = f"ply\nformat binary_little_endian 1.0\n{more}element vertex {count}\n"
    header += "".join(f"property {kind} {name}\n" for name in ("x", "y", "z", "opacity"))
    return header.encode() + b"end_header\n" + (b"\0" * 16 * count if rows is None else rows)


def spz(
    version: int = 3, count: int = 2, degree: int = 0, magic: bytes = b"NGSP", more: bytes = b""
) -> bytes:
    header = struct.pack("<4sIIBBBB", magic, version, count, degree, 12, 0, 0)
    row = (19 if version == 2 else 20) + 3 * ((degree + 1) ** 2 - 1)
    return gzip.compress(header + b"\0" * row * min(count, 10) + more, mtime=0)


def test_a_whole_person_reads_back(tmp_path):
    files = whole_files() | {"background.ply": ply()}
    write_bundle(tmp_path / "a.ico3d", whole_manifest(), files)
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.manifest.is_whole and bundle.manifest.version == VERSION
    assert bundle.head is not None and bundle.window(1).num_gaussians == 23
    assert bundle.world_from_head.shape == (FRAMES, 4, 4)
    assert bundle.background == "background.ply"
    assert bundle.animation.rest.end == 2 and bundle.animation.num_frames == FRAMES
    assert bundle.read("background.ply") == ply()
    assert json.loads(bundle.read("animation.json")) == ANIMATION


def test_a_head_alone_has_no_animation_and_may_have_a_background(tmp_path):
    head = random_head(50)
    files = random_files(head)
    write_bundle(tmp_path / "a.ico3d", random_manifest(head), files)
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert bundle.animation is None and bundle.background is None
    files["background.spz"] = spz()
    write_bundle(tmp_path / "b.ico3d", random_manifest(head), files)
    assert Bundle.open(tmp_path / "b.ico3d").background == "background.spz"
    with pytest.raises(BundleError, match=r"animation\.json: does not belong"):
        write_bundle(tmp_path / "c.ico3d", random_manifest(head), files | {"animation.json": b""})


def refused_when_written(tmp_path, manifest, files, message: str) -> None:
    with pytest.raises(BundleError, match=message) as caught:
        write_bundle(tmp_path / "a.ico3d", manifest, files)
    assert not (tmp_path / "a.ico3d").exists() and "\n" not in str(caught.value)


def test_head_and_body_must_agree_on_frames(tmp_path):
    manifest = whole_manifest()
    faster = replace(manifest, head=replace(manifest.head, fps=25.0))
    longer = replace(manifest, head=replace(manifest.head, num_poses=FRAMES + 1))
    refused_when_written(tmp_path, faster, whole_files(), r"head\.fps must be that of the body")
    refused_when_written(tmp_path, longer, whole_files(), r"num_poses must be 7, one per frame")


def test_a_whole_person_needs_its_animation(tmp_path):
    files = whole_files()
    del files["animation.json"]
    refused_when_written(tmp_path, whole_manifest(), files, r"animation\.json: is missing")


def test_one_background_is_enough(tmp_path):
    files = whole_files() | {"background.ply": ply(), "background.spz": spz()}
    refused_when_written(tmp_path, whole_manifest(), files, "not both")
    files = whole_files() | {"background.splat": b"x"}
    refused_when_written(tmp_path, whole_manifest(), files, "does not belong")


OTHER_BODY = json.dumps({**ANIMATION, "fps": 25.0}).encode()


@pytest.mark.parametrize(
    "animation", [b"", b"[]", b"{", b'{"version": 1}', b"NaN", b"\xff", OTHER_BODY]
)
def test_a_hostile_animation_is_refused(tmp_path, animation):
    path = tmp_path / "a.ico3d"
    write_bundle(path, whole_manifest(), whole_files() | {"animation.json": animation})
    with pytest.raises(BundleError, match=r"animation\.json") as caught:
        Bundle.open(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name, data",
    [
        ("background.spz", spz(2)),
        ("background.spz", spz(3, degree=3)),
        ("background.spz", struct.pack("<4sIIBBBB", b"NGSP", 4, 5, 0, 12, 0, 6) + b"\0" * 200),
        ("background.ply", ply(1)),
        ("background.ply", ply(more="element face 0\n")),
        ("background.ply", ply().replace(b"\n", b"\r\n")),
    ],
)
def test_backgrounds_that_are_read(name, data):
    check_background(data, name)


@pytest.mark.parametrize(
    "name, data, message",
    [
        ("background.spz", b"", "does not begin a header"),
        ("background.spz", b"\x1f\x8b" + b"\0" * 40, "gzip stream is damaged"),
        ("background.spz", gzip.compress(b"NGSP", mtime=0), "does not begin a header"),
        ("background.spz", spz(magic=b"EVIL"), "does not begin a header"),
        ("background.spz", spz(9), "SPZ version 9"),
        ("background.spz", spz(4), "SPZ version 4 at byte 4 of a gzip stream"),
        ("background.spz", spz(degree=4), "SH degree 4"),
        ("background.spz", spz(count=0), "must hold 1 to"),
        ("background.spz", spz(count=1_000_001), "must hold 1 to"),
        ("background.spz", spz(count=900_000), "promises 900000 Gaussians"),
        ("background.spz", spz()[:-9], "cut off"),
        ("background.spz", spz(count=11), "11 Gaussians need 236 bytes unpacked"),
        ("background.spz", spz(more=b"\0"), "data goes on after the last Gaussian"),
        ("background.ply", b"", "is not a PLY file"),
        ("background.ply", b"\nend_header\n", "is not a PLY file"),
        ("background.ply", ply().replace(b"binary_little_endian", b"ascii"), "must be of the"),
        ("background.ply", ply(2, b"\0" * 31), "its header promises"),
        ("background.ply", ply(2, b"\0" * 33), "its header promises"),
        ("background.ply", ply(0), "must hold 1 to"),
        ("background.ply", ply(10**18, b""), "must hold 1 to"),
        ("background.ply", ply("9" * 5000, b""), "declares what no file"),
        ("background.ply", ply(kind="list uchar int"), "declares what no file"),
        ("background.ply", ply(more="element vertex 2\n"), "declares what no file"),
        ("background.ply", ply(kind="complex"), "declares what no file"),
        ("background.ply", ply(more=f"element rows {10**11}\n"), "rows without columns"),
        ("background.ply", b"ply\n" + b"comment x\n" * 10_000 + ply(), "is not a PLY file"),
    ],
)
def test_hostile_backgrounds_are_refused_in_one_sentence(name, data, message):
    with pytest.raises(BundleError, match=message) as caught:
        check_background(data, name)
    assert str(caught.value).startswith(name) and "\n" not in str(caught.value)


def test_a_background_that_unpacks_to_far_more_is_refused_before_its_end():
    """What its header says of two Gaussians is true; what follows would be unpacked by the page."""
    data = spz(more=b"\0" * (4 << 20))
    tracemalloc.start()
    with pytest.raises(BundleError, match="data goes on after the last Gaussian"):
        check_background(data, "background.spz")
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


def test_a_background_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr("ico3d.bundle.limits.MAX_BACKGROUND_BYTES", 100)
    with pytest.raises(BundleError, match="larger than 100 bytes"):
        check_background(ply(), "background.ply")


@settings(max_examples=150)
@given(st.sampled_from([spz(), ply()]), st.data())
def test_a_damaged_background_is_refused_or_as_good(good, data):
    at = data.draw(st.integers(0, len(good) - 1))
    bad = good[:at] + bytes([data.draw(st.integers(0, 255))]) + good[at + 1 :]
    for name in ("background.spz", "background.ply"):
        try:
            check_background(bad, name)
        except BundleError as error:
            assert str(error).startswith(name)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_flipped_byte_never_passes_as_another_person(tmp_path, data):
    path = tmp_path / "a.ico3d"
    manifest = write_random_whole(path)
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    try:
        found = Bundle.open(path)
    except BundleError:
        return
    assert found.manifest.files == manifest.files
    assert np.isfinite(found.world_from_head).all()
