"""`ico3d bundle info`, and the name of the packaged avatar."""

import json
import zipfile
from dataclasses import replace

import pytest

from ico3d.bundle import packaged
from ico3d.bundle.format import Bundle, write_bundle
from ico3d.bundle.people.provenance import Provenance
from ico3d.cli import main
from ico3d.errors import BundleError
from support.bundles.random_body import write_random_body
from support.bundles.random_bundle import random_files, random_head, random_manifest
from support.bundles.random_whole import write_random_whole


def info(path, tmp_path) -> dict:
    assert main(["bundle", "info", str(path), "--json", str(tmp_path / "info.json")]) == 0
    return json.loads((tmp_path / "info.json").read_text())


def test_what_is_said_of_a_whole_person(tmp_path, capsys):
    path = tmp_path / "a.ico3d"
    write_random_whole(path)
    found = info(path, tmp_path)
    assert found["bytes"] == path.stat().st_size
    assert (found["head_gaussians"], found["body_windows"]) == (60, 2)
    assert found["body_gaussians"] == [20, 23] and found["body_seconds"] == pytest.approx(0.4)
    assert found["provenance"] == {
        "kind": "random",
        "sources": ["random numbers"],
        "consent": "none needed",
        "licence": "CC0-1.0",
    }
    assert found["animation"] is True and found["inputs"] == "speech"
    printed = capsys.readouterr().out
    assert "body_gaussians     20; 23" in printed and "kind: random" in printed


def test_a_folder_has_the_bytes_of_its_files(tmp_path):
    write_random_whole(tmp_path / "a.ico3d")
    with zipfile.ZipFile(tmp_path / "a.ico3d") as archive:
        archive.extractall(tmp_path / "folder")
        expected = sum(entry.file_size for entry in archive.infolist())
    assert info(tmp_path / "folder", tmp_path)["bytes"] == expected


def test_a_body_has_no_head(tmp_path):
    write_random_body(tmp_path / "a.ico3d")
    found = info(tmp_path / "a.ico3d", tmp_path)
    assert found["head_gaussians"] is None and found["animation"] is False


def test_what_is_no_bundle_is_named(tmp_path, capsys):
    assert main(["bundle", "info", str(tmp_path / "nothing")]) == 1
    assert "there is no bundle at" in capsys.readouterr().err


def test_demo_is_the_packaged_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo").mkdir()  # not this
    monkeypatch.setattr(packaged, "FILE", tmp_path / "packaged.ico3d")
    with pytest.raises(BundleError, match="no demo avatar"):
        Bundle.open("demo")
    write_random_whole(tmp_path / "packaged.ico3d")
    assert Bundle.open("demo").manifest.name == "random person"
    assert info("demo", tmp_path)["bytes"] == (tmp_path / "packaged.ico3d").stat().st_size


def test_a_terminal_obeys_nothing_that_a_bundle_says(tmp_path, capsys):
    head = random_head(10)
    provenance = Provenance("\x1b]0;x\x07", ("a\nfiles  none",), "agreed", "CC0-1.0", "\u202eAda")
    manifest = replace(random_manifest(head), provenance=provenance)
    write_bundle(tmp_path / "a.ico3d", manifest, random_files(head))
    assert main(["bundle", "info", str(tmp_path / "a.ico3d")]) == 0
    told = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("provenance"))
    assert r"kind: \x1b]0;x\x07, sources: a\nfiles  none, consent: agreed" in told
    assert r"likeness: \u202eAda" in told
