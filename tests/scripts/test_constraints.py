"""constraints.txt holds versions that pyproject.toml allows, and that every machine can have."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LINES = [
    line
    for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    if not line.startswith("#")
]
PINS = dict(line.split("==") for line in LINES)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = {"": PROJECT["dependencies"], **PROJECT["optional-dependencies"]}
NEEDED = ("", "train", "face", "body", "synthetic", "voice", "chat", "watch", "cluster", "dev")
"""Extras that `make install` brings on every machine; all they name must be pinned."""


def test_each_line_is_one_public_version():
    for line in LINES:
        assert re.fullmatch(r"[a-z0-9-]+==[0-9][0-9a-z.]*", line), line
    assert list(PINS) == sorted(PINS), "written by scripts/write_constraints.py"


@pytest.mark.parametrize("extra", EXTRAS)
def test_versions_are_those_that_the_project_allows(extra):
    for text in EXTRAS[extra]:
        asked = Requirement(text)
        version = PINS.get(canonicalize_name(asked.name))
        if version is None:
            assert extra not in NEEDED, f"{asked.name} is not in constraints.txt"
        else:
            assert asked.specifier.contains(version, prereleases=True), f"{text}, not {version}"


def test_setup_installs_these_versions():
    setup = (ROOT / "scripts" / "setup.sh").read_text("utf-8")
    installs = re.findall(r"^ *install [$].*", setup, re.MULTILINE)
    assert len(installs) == 2  # what serves, and everything
    assert all("$tested" in line for line in installs)
    assert "-c constraints.txt" in setup
