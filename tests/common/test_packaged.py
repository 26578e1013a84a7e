"""Bundles of MediaPipe's made of a package: a tiny wheel through pip itself, then the real one."""

import hashlib
import io
import re
import subprocess
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from ico3d.cli import main
from ico3d.common.catalogue import table as room
from ico3d.common.catalogue.kinds import ModelPackage, PackagedModel, RemoteFile, Weights
from ico3d.common.downloads.mediapipe_bundle import with_normalisation
from ico3d.common.downloads.packaged import make_from_package
from support.needs import needs
from support.shared import SHARED
from support.tiny_tflite import read_model, write_model
from support.weights.wheels import only_from, write_wheel

pytestmark = [pytest.mark.slow, needs("mediapipe")]

NOBODY = "http://127.0.0.1:9/tiny.task"
LABELS = {"labels.txt": b"Left\nRight\n"}


@pytest.fixture(autouse=True)
def alone(tmp_path, monkeypatch):
    """A home of its own, and pip that finds only what lies in a folder."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    monkeypatch.setenv("COLUMNS", "1000")
    (tmp_path / "wheels").mkdir()
    only_from(tmp_path / "wheels", monkeypatch)


@pytest.fixture
def models():
    plain = write_model(1)
    labelled = with_normalisation(write_model(2, 3, LABELS), "older metadata", 3.0, 4.0)
    return {"tinypipe/modules/a.tflite": plain, "tinypipe/modules/b.tflite": labelled}


@pytest.fixture
def tiny(models, monkeypatch):
    """Weights of the table that nobody serves, made of the wheel with those models."""
    (first, one), (second, two) = (
        (path, hashlib.sha256(data).hexdigest()) for path, data in models.items()
    )
    packaged = (
        PackagedModel("detector.tflite", first, one, 127.5, 127.5),
        PackagedModel("landmarks.tflite", second, two, 0.0, 255.0),
    )
    package = ModelPackage("tinypipe", "1.2.3", 2_000, packaged)
    weights = Weights(
        "tiny", "a test", 2_000, "MIT", (RemoteFile("tiny.task", NOBODY),), package=package
    )
    monkeypatch.setitem(room.TABLE, "tiny", weights)
    return weights


def home(tmp_path):
    folder = tmp_path / "home" / ".cache" / "ico3d" / "models"
    return folder, sorted(path.name for path in folder.glob("*")) if folder.exists() else []


def test_what_cannot_be_downloaded_is_made_of_the_package(tiny, models, tmp_path, capfd):
    write_wheel(tmp_path / "wheels", models)
    assert main(["weights", "fetch", "tiny"]) == 0
    said = capfd.readouterr().out
    assert "where that fails, made of the Python package tinypipe 1.2.3 (2 kB, by pip" in said
    assert "cannot be downloaded" in said and "tinypipe 1.2.3 instead" in said
    folder, names = home(tmp_path)
    assert names == ["tiny.task"] and f"tiny is here: {folder / 'tiny.task'}" in said

    with zipfile.ZipFile(folder / "tiny.task") as bundle:
        assert bundle.namelist() == ["detector.tflite", "landmarks.tflite"]
        for info, seed, scale in zip(
            bundle.infolist(), (1, 2), ((127.5, 127.5), (0.0, 255.0)), strict=True
        ):
            assert (info.header_offset + len(info.FileHeader())) % 4 == 0
            assert info.compress_type == zipfile.ZIP_STORED
            weights, normalisation = read_model(bundle.read(info))
            assert normalisation == scale
            expected = np.random.default_rng(seed).integers(0, 256, 200, np.uint8)
            np.testing.assert_array_equal(weights, expected)
        with zipfile.ZipFile(io.BytesIO(bundle.read("landmarks.tflite"))) as labels:
            assert {name: labels.read(name) for name in labels.namelist()} == LABELS

    make_from_package(tiny.package, tmp_path / "again.task")
    assert (tmp_path / "again.task").read_bytes() == (folder / "tiny.task").read_bytes()


def test_the_official_file_comes_first(tiny, tmp_path, monkeypatch, capfd):
    (tmp_path / "official.task").write_bytes(b"PK of its author")
    file = RemoteFile("tiny.task", (tmp_path / "official.task").as_uri())
    monkeypatch.setitem(room.TABLE, "tiny", replace(tiny, files=(file,)))
    assert main(["weights", "fetch", "tiny"]) == 0
    assert "instead" not in capfd.readouterr().out
    folder, names = home(tmp_path)
    assert names == ["tiny.task"]
    assert (folder / "tiny.task").read_bytes() == b"PK of its author"


def test_where_neither_works_one_sentence_says_why_of_both(tiny, tmp_path, capfd):
    assert main(["weights", "fetch", "tiny"]) == 1
    error = capfd.readouterr().err
    assert "tiny.task can neither be downloaded nor made of the Python package" in error
    assert f"{NOBODY} cannot be downloaded" in error
    assert "pip cannot download tinypipe==1.2.3 (No matching distribution found for" in error
    assert f"Put a copy of it into {home(tmp_path)[0]}." in error
    assert home(tmp_path)[1] == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data[:-1] + b"?", r"b.tflite in the package tinypipe 1.2.3 .* not the file"),
        (lambda data: None, r"tinypipe 1.2.3 that pip downloaded has no file .*b.tflite"),
    ],
)
def test_another_model_is_refused(tiny, models, tmp_path, capfd, change, says):
    changed = {p: change(d) if "b.tf" in p else d for p, d in models.items()}
    write_wheel(tmp_path / "wheels", {p: d for p, d in changed.items() if d is not None})
    assert main(["weights", "fetch", "tiny"]) == 1
    error = capfd.readouterr().err
    assert re.search(says, error)
    assert home(tmp_path)[1] == []


def test_without_mediapipe_it_says_what_to_install(tiny, models, tmp_path, monkeypatch, capfd):
    write_wheel(tmp_path / "wheels", models)
    monkeypatch.setitem(sys.modules, "mediapipe.tasks.metadata", None)
    assert main(["weights", "fetch", "tiny"]) == 1
    assert "pip install 'ico3d[face]'" in capfd.readouterr().err
    assert home(tmp_path)[1] == []


@pytest.fixture(scope="module")
def real_wheels(tmp_path_factory):
    """A folder with the wheel that the table names."""
    folder = tmp_path_factory.mktemp("real")
    package = room.TABLE["pose-landmarker"].package
    assert package is not None and package == replace(
        room.TABLE["hand-landmarker"].package, models=package.models
    )
    named = f"{package.package}=={package.version}"
    options = ["--no-deps", "--only-binary", ":all:", "--platform", "manylinux_2_28_x86_64"]
    options += ["--python-version", "3.11", "--implementation", "cp", "--retries", "0"]
    command = [sys.executable, "-m", "pip", "download", *options, "--dest", str(folder), named]
    try:
        subprocess.run(command, capture_output=True, timeout=40, check=True)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        pytest.skip(f"pip cannot download {named} within 40 s")
    assert next(folder.glob("*.whl")).stat().st_size == package.size
    return folder


def parts(data):
    """A model without the files behind it, and these."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        first = min((info.header_offset for info in archive.infolist()), default=len(data))
        return data[:first], {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def real_bundles(real_wheels, tmp_path_factory):
    """The two bundles, made of the real wheel."""
    folder, paths = tmp_path_factory.mktemp("bundles"), []
    with pytest.MonkeyPatch.context() as patch:
        only_from(real_wheels, patch)
        for name in ("pose-landmarker", "hand-landmarker"):
            weights = room.TABLE[name]
            paths.append(folder / weights.files[0].name)
            make_from_package(weights.package, paths[-1])
    return paths


def test_mediapipe_opens_what_the_real_package_makes(real_bundles):
    from ico3d.capture.posing.seeing.mediapipe_body import BodyReader

    reader = BodyReader(*real_bundles)
    blank = np.zeros((64, 64, 3), np.uint8)
    assert reader.body(blank) is None and reader.hand(blank) is None
    reader.close()


def test_the_real_package_makes_what_mediapipes_own_writer_makes(real_bundles):
    for path in real_bundles:
        given = SHARED / "models" / path.name  # by the writer of MediaPipe 0.10.21
        if not given.is_file():
            pytest.skip(f"no {path.name} beside the checkout to compare with")
        with zipfile.ZipFile(path) as made, zipfile.ZipFile(given) as other:
            assert made.namelist() == other.namelist()
            for model in made.namelist():
                assert parts(made.read(model)) == parts(other.read(model))
