"""CONTRIBUTING.md sends nobody to a place that is not there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
ROW = re.compile(
    r"^\| (?P<what>[^|]+) \| `(?P<file>[^`|]+)` \| (?P<names>`[^|]+`) \|$", re.MULTILINE
)
ROWS = [(row["file"], re.findall(r"`([^`]+)`", row["names"])) for row in ROW.finditer(TEXT)]


def defined(tree, within=""):
    """Names that Python code defines: of a module, and `Class.name` of its classes."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield within + node.name
            yield from defined(node, f"{within}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield within + node.name
        else:
            targets = getattr(node, "targets", [getattr(node, "target", None)])
            names = (name for t in targets if t for name in getattr(t, "elts", [t]))
            yield from (within + name.id for name in names if isinstance(name, ast.Name))


def test_there_are_twenty_rows_and_no_other():
    tables = TEXT.split("| to change | open | look for |\n")[1:]
    lines = [line for table in tables for line in table.partition("\n\n")[0].splitlines()]
    assert len(ROWS) == len(lines) - len(tables), "a row has another form than the others"
    assert len(ROWS) >= 20


def test_every_room_has_a_row():
    code = [*ROOT.glob("src/ico3d/**/*.py"), *ROOT.glob("viewer/src/**/*.ts")]
    rooms = {file.parent.relative_to(ROOT) for file in code if file.name != "__init__.py"}
    assert rooms == {Path(file).parent for file, _ in ROWS} & rooms


@pytest.mark.parametrize(("file", "names"), ROWS, ids=lambda value: str(value))
def test_what_is_sought_is_there(file, names):
    text = (ROOT / file).read_text("utf-8")
    if file.endswith(".py"):
        there = set(defined(ast.parse(text)))
        assert set(names) <= there, f"{file} defines no {set(names) - there}"
    else:
        for name in names:
            assert re.search(rf"(?<!\w){re.escape(name)}\b", text), f"{file} has no {name}"
