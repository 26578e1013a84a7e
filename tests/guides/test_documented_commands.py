"""Every command that pages, scripts and the Makefile show is one that is taken as it is written."""

import importlib.util
import json
import re
import shlex
import sys
from dataclasses import is_dataclass
from itertools import product
from pathlib import Path
from types import ModuleType

import pytest
import tyro

from guides.written_commands import PAGES, ROOT, named, of_script, of_target, shown
from ico3d import cli

pytestmark = pytest.mark.slow

GROUPED = re.compile(r"--[a-z0-9-]+\.[a-z0-9-]+")
"""An option with the name of its group."""
SCRIPTS = sorted([*(ROOT / "bench").glob("*.py"), *(ROOT / "bench").glob("*/__main__.py")])
PACKAGE = json.loads((ROOT / "viewer" / "package.json").read_text("utf-8"))
TARGETS = re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)


@pytest.fixture(scope="module", autouse=True)
def neighbours():
    """Scripts of `bench/` import one another by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "bench")
        yield


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_shows_is_taken(page, capsys):
    for words in shown(page):
        assert taken(words), f"{shlex.join(words)}: {capsys.readouterr().err}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_names_is_taken(page, capsys):
    """In a sentence, folders and files may be left out, and the value of the last option."""
    for words in named(page):
        assert exists(words) or taken(words) or any(taken(more) for more in completed(words)), (
            f"{shlex.join(words)}: {capsys.readouterr().err}"
        )


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.relative_to(ROOT).as_posix())
def test_what_a_script_says_of_itself_is_taken(script, capsys):
    for words in of_script(script):
        assert taken(words), f"{shlex.join(words)}: {capsys.readouterr().err}"


def test_what_make_bench_runs_is_taken(capsys):
    commands = of_target("bench", SUBJECT="subject.npz", OPPONENT="opponent.py")
    assert sum("bench/" in word for words in commands for word in words) > 5
    for words in commands:
        assert taken(words), f"{shlex.join(words)}: {capsys.readouterr().err}"


def test_there_are_commands_to_look_at():
    assert sum(len(shown(page)) for page in PAGES) > 80
    assert sum(len(named(page)) for page in PAGES) > 150
    benchmarks = named(ROOT / "docs" / "benchmarks.md")
    assert {words[1] for words in benchmarks if words[0] == "python"} > {"bench/step.py"}
    assert sum(len(words) > 3 for words in benchmarks) > 20


def test_options_that_pages_name_exist(capsys):
    known = set()
    for verb in cli.VERBS:
        with pytest.raises(SystemExit):
            cli.main([*verb.split(), "--help"])
        known |= set(GROUPED.findall(capsys.readouterr().out))
    told = {name for page in PAGES for name in GROUPED.findall(page.read_text("utf-8"))}
    assert len(told) > 10 and told <= known


def exists(words: list[str]) -> bool:
    """Whether a name without options, as sentences mention it, is one of a verb or a script."""
    name = " ".join(words[1:])
    if words[0] == "ico3d":
        return any(name in (verb, verb.split()[0]) for verb in cli.VERBS)
    return ROOT / name in SCRIPTS


def taken(words: list[str]) -> bool:
    """Whether a command is one of ours, or another's, and its words mean something."""
    program, *rest = words
    if program == "ico3d":
        return taken_by_verb(rest)
    if program == "make":
        return all(word in TARGETS or is_variable(word) for word in rest)
    if program == "npm":
        return rest[0] in ("ci", "pack", "test") or rest[-1] in PACKAGE["scripts"]
    if program == "npx":
        return all((ROOT / "viewer" / word).exists() for word in rest if word.endswith(".ts"))
    if program.endswith("python") and rest[0].startswith("bench/"):
        return taken_by_script(ROOT / rest[0], rest[1:])
    if program == "python" and rest[0] == "-m" and rest[1].startswith("ico3d."):
        return importlib.util.find_spec(rest[1]) is not None
    return True


def is_variable(word: str) -> bool:
    """Whether a word gives a value to a variable of the Makefile."""
    name, equals, _ = word.partition("=")
    return bool(equals) and f"$({name})" in (ROOT / "Makefile").read_text("utf-8")


def taken_by_verb(words: list[str]) -> bool:
    """Whether the command line takes some words."""
    verb = cli.verb_of(words)
    if verb is None:
        return words in ([], ["VERB", "--help"], ["--version"], ["--help"])
    return parses(lambda: cli.parsed(verb, words[len(verb.split()) :]))


def taken_by_script(script: Path, words: list[str]) -> bool:
    """Whether a script of `bench/` takes some words."""
    return parses(lambda: tyro.cli(settings_of(script), args=words, config=cli.STYLE))


def parses(parse) -> bool:
    """Whether words become settings, or a page of help."""
    try:
        parse()
    except SystemExit as end:
        return end.code == 0
    return True


def completed(words: list[str]):
    """A verb with as many files before its options as it may need, and a value for the last one."""
    verb = cli.verb_of(words[1:])
    if verb is None:
        return
    at = 1 + len(verb.split())
    for count, value in product(range(4), ([], ["VALUE"])):
        yield [*words[:at], *["FILE"] * count, *words[at:], *value]


def settings_of(script: Path) -> type:
    """The class whose fields are a script's options."""
    module = load(script)
    (found,) = (
        kind
        for kind in vars(module).values()
        if is_dataclass(kind) and hasattr(kind, "run") and kind.__module__ == module.__name__
    )
    assert isinstance(found, type)
    return found


def load(script: Path) -> ModuleType:
    """A script as a module that runs nothing."""
    script = script / "__main__.py" if script.is_dir() else script
    name = "bench." + ".".join(script.relative_to(ROOT / "bench").with_suffix("").parts)
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, script)
        assert spec is not None and spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]
