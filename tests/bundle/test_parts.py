"""Large heads and bodies on a skeleton in two files: what matters most, and the rest."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.bundle.format import Bundle, coarse_first, write_bundle
from ico3d.bundle.head import HEAD, HEAD_REST, BakedHead
from ico3d.bundle.manifest import Manifest
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.info import SKINNED, SKINNED_REST
from ico3d.errors import BundleError
from support.bundles.random_bundle import random_files, random_head, random_manifest, thumbnail
from support.bundles.random_skinned import random_skinned, skinned_manifest

COUNT = 60
HEAD_OF_60 = random_head(COUNT, rank=4, hidden=8)
MANIFEST = random_manifest(HEAD_OF_60)
FILES = random_files(HEAD_OF_60)
BODY = random_skinned()


def with_rest(rest: int):
    assert MANIFEST.head is not None
    return replace(MANIFEST.head, num_rest=rest)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, COUNT - 1))
def test_a_head_in_two_files_is_the_same_head(first):
    files = HEAD_OF_60.split(first)
    read = BakedHead.from_bytes(files[0], with_rest(COUNT - first), files[1])
    for name, tensor in vars(HEAD_OF_60).items():
        np.testing.assert_array_equal(getattr(read, name), tensor)


def test_a_body_in_two_files_is_the_same_body():
    files = BODY.split(7)
    info = replace(BODY.info, num_rest=BODY.info.num_gaussians - 7)
    read = BakedSkinned.from_bytes(files[0], info, files[1])
    for name, tensor in BODY.tensors.items():
        np.testing.assert_array_equal(read.tensors[name], tensor)


def test_the_first_file_alone_is_a_head_of_the_first_gaussians():
    first, _ = HEAD_OF_60.split(20)
    info = replace(with_rest(0), num_gaussians=20)
    read = BakedHead.from_bytes(first, info)
    np.testing.assert_array_equal(read.means, HEAD_OF_60.means[:20])
    np.testing.assert_array_equal(read.basis, HEAD_OF_60.basis[:, :20])
    np.testing.assert_array_equal(read.w1, HEAD_OF_60.w1)


def test_large_files_are_divided_and_read_back(tmp_path):
    most = len(FILES[HEAD]) // 2
    manifest = write_bundle(tmp_path / "a.ico3d", *coarse_first(MANIFEST, FILES, most))
    bundle = Bundle.open(tmp_path / "a.ico3d")
    assert manifest.head is not None and 0 < manifest.head.num_rest < COUNT
    assert len(bundle.read(HEAD)) < len(FILES[HEAD]) and HEAD_REST in bundle.names  # networks stay
    assert bundle.head is not None
    np.testing.assert_array_equal(bundle.head.basis, HEAD_OF_60.basis)
    entry = skinned_manifest(BODY)
    files = {SKINNED: BODY.to_bytes(), "thumbnail.png": thumbnail()}
    most = len(files[SKINNED]) // 2
    write_bundle(tmp_path / "b.ico3d", *coarse_first(entry, files, most))
    body = Bundle.open(tmp_path / "b.ico3d")
    assert SKINNED_REST in body.names and body.skinned is not None
    np.testing.assert_array_equal(body.skinned.shapes, BODY.shapes)


def test_small_files_stay_whole():
    assert coarse_first(MANIFEST, FILES) == (MANIFEST, FILES)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda head, rest: (head, b""), HEAD_REST),
        (lambda head, rest: (rest, head), HEAD),
        (lambda head, rest: (head, head), HEAD_REST),
        (lambda head, rest: (head, HEAD_OF_60.split(30)[1]), HEAD_REST),
    ],
)
def test_files_that_do_not_belong_together_are_refused(change, sentence):
    first, rest = change(*HEAD_OF_60.split(20))
    with pytest.raises(BundleError, match=sentence):
        BakedHead.from_bytes(first, with_rest(COUNT - 20), rest)


def test_a_missing_second_file_and_one_too_many_are_refused(tmp_path):
    manifest, files = coarse_first(MANIFEST, FILES, len(FILES[HEAD]) // 2)
    del files[HEAD_REST]
    with pytest.raises(BundleError, match=f"{HEAD_REST}: is missing"):
        write_bundle(tmp_path / "a.ico3d", manifest, files)
    with pytest.raises(BundleError, match="does not belong"):
        write_bundle(tmp_path / "b.ico3d", MANIFEST, FILES | {HEAD_REST: b""})


@pytest.mark.parametrize("rest", [-1, COUNT, 1.5, None])
def test_the_manifest_counts_what_is_there(rest):
    value = json.loads(MANIFEST.to_json())
    value["head"]["num_rest"] = rest
    with pytest.raises(BundleError, match="num_rest"):
        Manifest.from_json(json.dumps(value).encode())


def test_older_manifests_have_one_file():
    value = json.loads(MANIFEST.to_json()) | {"version": 4}
    del value["head"]["num_rest"]
    read = Manifest.from_json(json.dumps(value).encode())
    assert read.head == MANIFEST.head
    value["version"] = 5
    with pytest.raises(BundleError, match="lacks 'num_rest'"):
        Manifest.from_json(json.dumps(value).encode())
