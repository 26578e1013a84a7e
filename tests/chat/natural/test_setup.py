"""What `ico3d demo --natural` tells, asks and keeps."""

import io
import tomllib
from pathlib import Path

import pytest

from ico3d.chat.natural import needs, setup
from ico3d.chat.services import TABLES, choose
from ico3d.chat.settings.conversation import read_settings
from ico3d.cli import main
from ico3d.common.catalogue.table import TABLE

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def own_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)


def test_the_extra_has_these_packages_in_these_versions():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pinned = [f"{need.name}=={need.version}" for need in needs.PACKAGES]
    named = [line for line in extras["optional-dependencies"]["natural"] if "==" in line]
    assert named == pinned


def test_its_settings_choose_what_it_installs():
    chosen = choose(read_settings(needs.SETTINGS))
    assert chosen.recognition.options.model == "tiny.en"
    assert chosen.language.provider is TABLES["language"]["smollm2"]
    assert chosen.voice.provider is TABLES["voice"]["hibari"]
    assert [need.name for need in needs.missing_weights()] == list(needs.WEIGHTS)
    assert all(need.size == TABLE[need.name].package.size for need in needs.missing_weights())


def test_without_a_yes_nothing_is_installed(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("sys.stdin", io.StringIO())  # nobody is there to ask
    monkeypatch.setattr(needs, "PACKAGES", (needs.Need("no-such", "a test", 1, "MIT", "1.0"),))
    assert main(["demo", "--natural", "--no-browser"]) == 1
    told = capsys.readouterr()
    assert "add --yes" in told.err
    for word in ("no-such 1.0", "smollm2-135m", "71 MB", "Apache-2.0", "MIT"):
        assert word in told.out
    assert not list(tmp_path.iterdir())


def test_a_settings_file_of_ones_own_is_not_overruled(capsys, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text("")
    assert main(["demo", "--natural", "--settings", str(own)]) == 1
    assert "--natural has settings of its own" in capsys.readouterr().err


def test_an_older_version_counts_as_missing(monkeypatch):
    monkeypatch.setattr(needs, "version", lambda name: "1.2")
    found = needs.missing_packages()
    monkeypatch.setattr(needs, "version", lambda name: "99.0.1")
    assert [need.version for need in found] == [
        need.version for need in needs.PACKAGES if need.name not in ("gguf", "hibari-tts")
    ]
    assert needs.missing_packages() == []


def test_what_is_installed_is_kept_and_named_once():
    kept = setup.installed()
    names = [line.partition("==")[0] for line in kept]
    assert len(names) == len(set(names)) and "ico3d" not in names
    import numpy

    assert f"numpy=={numpy.__version__}" in kept
