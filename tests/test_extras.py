"""Errors about a missing package name an extra of ico3d that brings the package."""

import ast
import importlib.metadata
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
ERROR = "MissingExtraError"
"""Its first argument is a package, and its second is the extra that brings it."""


def named(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Place in the source, package and extra of each `ERROR`."""
    for file in sorted(folder.rglob("*.py")):
        text = file.read_text("utf-8")
        if ERROR not in text:
            continue
        tree = ast.parse(text)
        for call in calls(tree, ERROR):
            where = f"{file.relative_to(folder)}:{call.lineno}"
            package, extra = call.args[:2]
            assert isinstance(extra, ast.Constant), f"{where}: the extra must be written out"
            packages = values(package, call, tree)
            assert packages, f"{where}: nothing says which packages these are"
            yield from ((where, one, extra.value) for one in packages)


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    """All calls of functions of this name."""
    found = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [call for call in found if isinstance(call.func, ast.Name) and call.func.id == name]


def values(package: ast.expr, call: ast.Call, tree: ast.Module) -> list[str]:
    """The texts that an argument of a call may be, as far as the file tells.

    That is a literal; one behind `or`; what the calls of the function around pass on; or an entry
    of a constant that is gone through.
    """
    if not isinstance(package, ast.Name):
        known = [node.value for node in ast.walk(package) if isinstance(node, ast.Constant)]
        return [value for value in known if isinstance(value, str)]
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        names = [parameter.arg for parameter in function.args.args]
        if call in ast.walk(function) and package.id in names:
            passed = [one.args[names.index(package.id)] for one in calls(tree, function.name)]
            return [text for argument in passed for text in values(argument, call, tree)]
    for loop in (node for node in ast.walk(tree) if isinstance(node, ast.For)):
        if call in ast.walk(loop) and ast.unparse(loop.target) == package.id:
            return list(constant(ast.unparse(loop.iter), tree))
    return []


def constant(name: str, tree: ast.Module) -> tuple[str, ...]:
    """The value of a constant of a module."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return ast.literal_eval(node.value)
    return ()


@cache
def brought(extra: str) -> set[str]:
    """Packages that an extra brings, also by extras of the packages that it names."""
    about = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    needs = [Requirement(line) for line in about["project"]["optional-dependencies"][extra]]
    found = {canonicalize_name(need.name) for need in needs}
    for need in needs:
        found |= {name for part in need.extras for name in behind(need.name, part)}
    return found


def behind(package: str, extra: str) -> set[str]:
    """Packages that an extra of an installed package brings."""
    needs = [Requirement(line) for line in importlib.metadata.requires(package) or ()]
    wanted = [need for need in needs if need.marker and need.marker.evaluate({"extra": extra})]
    return {canonicalize_name(need.name) for need in wanted}


@pytest.mark.skipif(find_spec("pipecat") is None, reason="pipecat tells what its extras bring")
def test_each_extra_brings_the_package_that_is_missing():
    found = list(named(ROOT / "src/ico3d"))
    assert len(found) > 30
    wrong = [
        f"{where}: '{package}' is not brought by ico3d[{extra}]"
        for where, package, extra in found
        if canonicalize_name(package) not in brought(extra)
    ]
    assert wrong == []


def test_a_wrong_extra_would_be_found(tmp_path):
    (tmp_path / "one.py").write_text(
        'NEEDED = ("torch", "numba")\n'
        "def load(package):\n"
        '    raise MissingExtraError(package, "body", "this")\n'
        'load("h5py")\n'
        "for name in NEEDED:\n"
        '    MissingExtraError(name, "qwen", "it")\n'
        'MissingExtraError(error.name or "scipy", "train", "that")\n'
    )
    found = {entry[1:] for entry in named(tmp_path)}
    assert found == {("h5py", "body"), ("torch", "qwen"), ("numba", "qwen"), ("scipy", "train")}
    assert "torch" in brought("qwen") and "numba" not in brought("qwen")
