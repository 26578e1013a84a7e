"""The house stays in order: imports go one way, folders and files stay small."""

import re
import subprocess
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
MOST_FILES = 15
"""Loose Python files of a folder; `__init__.py` does not count."""
MOST_LINES = 400


@pytest.fixture(scope="module")
def python_files() -> list[Path]:
    """What git tracks, and what is new, relative to the repository."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "src", "tests", "bench"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if listed.returncode:
        pytest.skip("no git checkout")
    files = map(Path, listed.stdout.splitlines())
    return [file for file in files if file.suffix == ".py" and (ROOT / file).is_file()]


def test_no_file_imports_itself_by_way_of_others():
    """Layers and folders are kept by the contracts in pyproject.toml; files are looked at here."""
    found = grimp.build_graph("ico3d", cache_dir=None)
    graph = {module: found.find_modules_directly_imported_by(module) for module in found.modules}
    assert sum(map(len, graph.values())) > 1000
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the files


def test_folders_can_be_taken_in_at_a_glance(python_files):
    counts = Counter(file.parent.as_posix() for file in python_files if file.name != "__init__.py")
    assert counts["src/ico3d/splat"] > 5
    over = {folder: count for folder, count in counts.items() if count > MOST_FILES}
    assert over == {}


def test_files_can_be_taken_in_at_a_sitting(python_files):
    lengths = {
        file.as_posix(): (ROOT / file).read_text("utf-8").count("\n") for file in python_files
    }
    assert sum(lengths.values()) > 50_000
    assert {file: lines for file, lines in lengths.items() if lines > MOST_LINES} == {}


def test_packed_files_are_unpacked_in_one_place(python_files):
    """Elsewhere nobody would see to it that they unpack to no more than is taken."""
    calls = ("torch.load(", "np.load(")
    found = {
        (file.as_posix().removeprefix("src/ico3d/"), call)
        for file in python_files
        for call in calls
        if file.parts[0] == "src" and call in (ROOT / file).read_text("utf-8")
    }
    assert found == {
        ("common/unpacking/weights.py", "torch.load("),
    }


def test_questions_about_files_of_anybody_have_answers(python_files):
    """`Path.is_file` and the like raise before Python 3.14 where a link leads to a long name, in a
    circle, or to a folder that is not ours; `os.path` has functions that say no."""
    asked = re.compile(
        r"(?<!os\.path)(?<!\bentry)\.(is_file|is_dir|exists|is_symlink|resolve)\b(?!`)"
    )
    found = {
        f"{file}: {line.strip()}"
        for file in python_files
        if file.parts[0] == "src" and file.name != "http.py"  # resolves names of hosts
        for line in (ROOT / file).read_text("utf-8").splitlines()
        if asked.search(line)
    }
    assert asked.search("path.resolve()") and asked.search("map(Path.is_file, places)")
    assert found == set()
