import hashlib
import re
from pathlib import Path

import pytest

from ico3d.cli import main
from ico3d.common.catalogue import table as room
from ico3d.common.catalogue.kinds import FilesPackage, ModelPackage, RemoteFile, Weights
from ico3d.common.weights import cached, find_model, model_file
from ico3d.errors import MissingModelError, SettingsError


@pytest.fixture(autouse=True)
def own_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)


def test_every_entry_says_all_that_a_person_must_know():
    files = [file.name for weights in room.TABLE.values() for file in weights.files]
    assert len(files) == len(set(files))
    for name, weights in room.TABLE.items():
        assert weights.name == name and weights.purpose and weights.licence and weights.size > 0
        packed = isinstance(weights.package, FilesPackage)
        assert [bool(weights.files), bool(weights.repository), packed].count(True) == 1
        assert bool(weights.wanted) == bool(weights.repository)
        restricted = "NC" in weights.licence or "research" in weights.licence
        assert bool(weights.notice) == restricted
        if weights.package is not None:
            assert re.fullmatch(r"\d+\.\d+\.\d+", weights.package.version)
        ends = {Path(file.name).suffix for file in weights.files}
        if isinstance(weights.package, ModelPackage):
            assert len(weights.files) == 1 and ends == {".task"}
            for model in weights.package.models:
                assert model.name.endswith(".tflite") and model.path.endswith(".tflite")
                assert re.fullmatch(r"[0-9a-f]{64}", model.sha256)
        elif isinstance(weights.package, FilesPackage):
            for file in weights.package.files:
                assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
            assert len(weights.package.files) == 1 or not weights.package.converted
        elif weights.package is not None:
            assert ends == {".safetensors"} and all(file.keep for file in weights.files)
            assert re.fullmatch(r"[0-9a-f]{64}", weights.package.sha256)
        for file in weights.files:
            assert file.url.startswith("https://")
            assert re.fullmatch(r"([0-9a-f]{8}|[0-9a-f]{64})?", file.sha256)
            assert re.fullmatch(r"([0-9a-f]{40})?", file.git_blob)
            assert not (file.sha256 and file.git_blob)
            if len(file.sha256) == 8:  # PyTorch's convention: the name tells it
                assert f"-{file.sha256}.pth" in file.url


def test_single_files_are_found_in_the_users_folder_first(tmp_path, monkeypatch):
    assert cached("ave") is None
    cache = tmp_path / "home" / ".cache" / "ico3d" / "models"
    cache.mkdir(parents=True)
    (cache / "audio_visual_encoder.pth").touch()
    assert cached("ave") == cache / "audio_visual_encoder.pth"
    own = tmp_path / "own"
    own.mkdir()
    (own / "audio_visual_encoder.pth").touch()
    monkeypatch.setenv("ICO3D_MODELS", str(own))
    assert cached("ave") == own / "audio_visual_encoder.pth"
    assert model_file("audio_visual_encoder.pth", "x") == own / "audio_visual_encoder.pth"


def test_of_several_files_all_must_be_there(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    (tmp_path / "kokoro-v1.0.onnx").touch()
    assert cached("kokoro") is None
    (tmp_path / "voices-v1.0.bin").touch()
    assert cached("kokoro") == tmp_path


def test_a_repository_is_found_as_a_folder_of_its_name(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    folder = tmp_path / "OpenVoiceV2"
    (folder / "converter").mkdir(parents=True)
    assert cached("openvoice") is None  # a folder without the weights
    (folder / "converter" / "checkpoint.pth").touch()
    assert cached("openvoice") == folder


def test_a_repository_is_found_in_the_hubs_cache(tmp_path, monkeypatch):
    constants = pytest.importorskip("huggingface_hub.constants")
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    commit = hashlib.sha1(b"x").hexdigest()
    place = tmp_path / "hub" / "models--myshell-ai--OpenVoiceV2"
    snapshot = place / "snapshots" / commit
    (place / "refs").mkdir(parents=True)
    (place / "refs" / "main").write_text(commit)
    assert cached("openvoice") is None
    (snapshot / "converter").mkdir(parents=True)
    (snapshot / "converter" / "checkpoint.pth").touch()
    assert cached("openvoice") == snapshot


def test_a_missing_file_says_how_to_get_it():
    with pytest.raises(MissingModelError, match=r"ico3d weights fetch ave \(CC BY-NC 4\.0\)"):
        model_file("audio_visual_encoder.pth", "something")
    with pytest.raises(
        MissingModelError, match=r"the model file 'x\.bin' is not installed\. Put it into"
    ):
        model_file("x.bin", "something")
    with pytest.raises(SettingsError, match=r"no weights 'x': choose from face-landmarker, pose-"):
        cached("x")


def test_the_list_names_everything(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["weights", "list"]) == 0
    shown = capsys.readouterr().out
    for weights in room.TABLE.values():
        assert re.search(rf"{weights.name} .*{re.escape(weights.licence)}", shown)
    assert re.search(r"ave .*11 MB .*NC 4\.0\* .*git blob id", shown)


def test_a_binding_licence_needs_a_yes(capsys, monkeypatch, tmp_path):
    bound = Weights(
        "bound", "a test", 5, "CC BY-NC 4.0",
        (RemoteFile("bound.onnx", "http://127.0.0.1:9/bound.onnx"),), notice="Not for shops.",
    )  # fmt: skip
    monkeypatch.setitem(room.TABLE, "bound", bound)
    assert main(["weights", "fetch", "bound"]) == 1
    shown = capsys.readouterr()
    assert "5 bytes, CC BY-NC 4.0, checked by length" in shown.out
    assert "Not for shops." in shown.out and "add --yes" in shown.err
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    for answer, says in (("n", "was not downloaded"), ("y", "")):
        monkeypatch.setattr("builtins.input", lambda *_, answer=answer: answer)
        status = main(["weights", "fetch", "bound"])
        shown = capsys.readouterr()
        assert says in shown.out
        assert status == (0 if says else 1)  # nobody serves there
    assert "cannot be downloaded" in shown.err
    assert not list(Path(tmp_path).rglob("bound.onnx"))


def test_a_path_is_no_name_of_a_model(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path / "models"))
    (tmp_path / "models").mkdir()
    for file in (tmp_path / "outside.onnx", tmp_path / "models" / "inside.onnx"):
        file.write_bytes(b"")
    assert find_model("inside.onnx") == tmp_path / "models" / "inside.onnx"
    for name in (str(tmp_path / "outside.onnx"), "../outside.onnx", "..", ".", "", "./inside.onnx"):
        assert find_model(name) is None
