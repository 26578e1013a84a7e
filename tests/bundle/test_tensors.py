"""The tensors of a bundle: headers, shapes, values."""

import json
import struct

import numpy as np
import pytest

from ico3d.bundle.head import BakedHead, poses_from_bytes, poses_to_bytes
from ico3d.errors import BundleError
from support.bundles.random_bundle import random_head, random_manifest, swaying_poses

HEAD = random_head(30)
INFO = random_manifest(HEAD).head
DATA = HEAD.to_bytes()


def with_header(change) -> bytes:
    """The file with an altered header."""
    (length,) = struct.unpack_from("<Q", DATA)
    header = json.loads(DATA[8 : 8 + length])
    change(header)
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + DATA[8 + length :]


def refused(data: bytes, message: str) -> None:
    with pytest.raises(BundleError, match=message) as caught:
        BakedHead.from_bytes(data, INFO)
    assert str(caught.value).startswith("head.safetensors")


def test_other_programs_can_read_it():
    from safetensors.numpy import load

    tensors = load(DATA)
    assert tensors["basis"].dtype == np.int8 and tensors["basis"].shape == (16, 30, 4)
    assert {key: value.dtype.name for key, value in tensors.items() if value.ndim < 3} == {
        "means": "float32",
        "quats": "float16",
        "scales": "float16",
        "mean_logits": "float16",
        "basis_scale": "float32",
        "displacement_w1": "float32",
        "displacement_b1": "float32",
        "displacement_w2": "float32",
        "displacement_b2": "float32",
        "w1": "float32",
        "b1": "float32",
        "w2": "float32",
        "b2": "float32",
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h: h.pop("means"), "lacks tensor 'means'"),
        (lambda h: h.update(more=h["b1"]), "unknown tensor 'more'"),
        (lambda h: h["means"].update(dtype="F16"), "'means' must be F32"),
        (lambda h: h["means"].update(shape=[3, 30]), "'means' must be F32"),
        (lambda h: h["means"].update(shape=[10**12, 3]), "'means' must be F32"),
        (lambda h: h["means"].update(data_offsets=[0, 10**15]), "must take"),
        (lambda h: h["means"].update(data_offsets=[10**15, 10**15 + 360]), "outside the file"),
        (lambda h: h["means"].update(data_offsets=[-360, 0]), "must take"),
        (lambda h: h["means"].update(data_offsets="0"), "malformed offsets"),
        (lambda h: h.update(means=3), "malformed header entry"),
        (lambda h: h["b1"].update(data_offsets=h["b2"]["data_offsets"]), "must take"),
        (lambda h: h["quats"].update(data_offsets=[0, 240]), "overlap"),
    ],
)
def test_a_wrong_header_is_refused(change, message):
    refused(with_header(change), message)


@pytest.mark.parametrize("length", [2**63, 1 << 20, len(DATA)])
def test_a_header_of_impossible_length_is_refused(length):
    refused(struct.pack("<Q", length) + DATA[8:], "impossible length")


def test_bytes_that_belong_to_no_tensor_are_refused():
    refused(DATA + b"\0", "belong to no tensor")


@pytest.mark.parametrize("name", ["means", "quats", "scales", "mean_logits", "w1", "b2"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(name, value):
    (length,) = struct.unpack_from("<Q", DATA)
    begin = 8 + length + json.loads(DATA[8 : 8 + length])[name]["data_offsets"][0]
    raw = np.array([value], getattr(HEAD, name).dtype).tobytes()
    refused(DATA[:begin] + raw + DATA[begin + len(raw) :], f"'{name}' holds")


@pytest.mark.parametrize(("name", "value"), [("means", 2e4), ("scales", 11), ("quats", 0.5)])
def test_values_out_of_range_are_refused(name, value):
    array = getattr(HEAD, name).copy()
    array[0] = value * np.ones_like(array[0])
    if name == "quats":
        array[0] *= 3
    with pytest.raises(BundleError, match=name):
        BakedHead(**{**vars(HEAD), name: array}).to_bytes()


@pytest.mark.parametrize("name", ["means", "basis"])
def test_a_wrong_dtype_is_not_written(name):
    with pytest.raises(BundleError, match=f"'{name}' must be"):
        BakedHead(**{**vars(HEAD), name: getattr(HEAD, name).astype(np.float64)}).to_bytes()


def test_poses_round_trip():
    poses = swaying_poses(7)
    np.testing.assert_array_equal(poses_from_bytes(poses_to_bytes(poses), 7), poses)
    with pytest.raises(BundleError, match="head_poses"):
        poses_from_bytes(poses_to_bytes(poses), 8)


@pytest.mark.parametrize("change", [np.nan, np.inf, 1e30, 2.0, -1.0])
def test_a_pose_that_is_not_rigid_is_named(change):
    poses = swaying_poses(5)
    poses[3, 0, 0] = change
    with pytest.raises(BundleError, match="pose 3"):
        poses_to_bytes(poses)
