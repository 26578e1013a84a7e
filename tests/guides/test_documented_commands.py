"""Every command that a page shows is one that the command line takes."""

import re
import shlex
from pathlib import Path

import pytest

from ico3d import cli

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(?:sh|bash)\n(.*?)^```", re.MULTILINE | re.DOTALL)
GROUPED = re.compile(r"--[a-z0-9-]+\.[a-z0-9-]+")
"""An option with the name of its group."""


def commands(page: Path) -> list[list[str]]:
    """The words of every line of a page's sh blocks that begins with ico3d."""
    lines = "".join(BLOCK.findall(page.read_text("utf-8"))).replace("\\\n", " ").splitlines()
    found = [shlex.split(line, comments=True) for line in lines if line.startswith("ico3d ")]
    return [_first(words)[1:] for words in found]


def _first(words: list[str]) -> list[str]:
    """The first command of a line."""
    ends = [index for index, word in enumerate(words) if word in ("&&", "&", "|", ";")]
    return words[: min(ends, default=len(words))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_command_line_takes_what_is_shown(page, capsys):
    for words in commands(page):
        verb = cli.verb_of(words)
        assert verb is not None, words
        try:
            cli.parsed(verb, words[len(verb.split()) :])
        except SystemExit:
            pytest.fail(f"ico3d {shlex.join(words)}: {capsys.readouterr().err}")


def test_there_are_commands_to_look_at():
    assert sum(len(commands(page)) for page in PAGES) > 60


def test_options_that_pages_name_exist(capsys):
    known = set()
    for verb in cli.VERBS:
        with pytest.raises(SystemExit):
            cli.main([*verb.split(), "--help"])
        known |= set(GROUPED.findall(capsys.readouterr().out))
    named = {name for page in PAGES for name in GROUPED.findall(page.read_text("utf-8"))}
    assert len(named) > 10 and named <= known
