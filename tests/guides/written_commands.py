"""The commands that pages and scripts show."""

import re
import shlex
import subprocess
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        ROOT / "examples" / "README.md",
        ROOT / "viewer" / "README.md",
    ]
)
FENCE = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
PROMPT = re.compile(r"^(?:# |\w+\$ +)")
"""What may stand before a command: a comment in the file that it is about, a machine's prompt."""
COMMAND = re.compile(r"(?:ico3d|python|\S*/python|make|npm|npx|cd viewer &&) ")
ENDS = {"&&", "&", "|", ";"}
SIGNS = re.compile(r"…|[\[\]]")
"""Says in a sketch of a command that something is left out, or may be."""


def shown(page: Path) -> list[list[str]]:
    """The words of every command in a page's blocks."""
    return _commands(
        line for text in FENCE.findall(page.read_text("utf-8")) for line in _lines(text)
    )


def named(page: Path) -> list[list[str]]:
    """The words of every command in a page's sentences, without signs of what may be left out."""
    sentences = FENCE.sub("", page.read_text("utf-8"))
    return _commands(SIGNS.sub("", span) for span in SPAN.findall(sentences))


def of_script(script: Path) -> list[list[str]]:
    """The words of every command that a script's docstring shows in lines of its own."""
    docstring = script.read_text("utf-8").split('"""')[1]
    indented = [line.strip() for line in _lines(docstring) if line.startswith("    ")]
    return _commands(SIGNS.sub("", line) for line in indented)


def of_target(name: str, **variables: str) -> list[list[str]]:
    """The words of every command that a target of the Makefile would run."""
    plan = subprocess.run(
        ["make", "--dry-run", name, *(f"{key}={value}" for key, value in variables.items())],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return _commands(plan.stdout.splitlines())


def _lines(text: str) -> list[str]:
    """Whole lines: those that end in a backslash go on."""
    return text.replace("\\\n", " ").splitlines()


def _commands(lines: Iterable[str]) -> list[list[str]]:
    """The words of every command in lines that are commands; a line may hold several."""
    found: list[list[str]] = []
    for line in (PROMPT.sub("", line) for line in lines):
        if not COMMAND.match(line):
            continue
        found.append([])
        for word in shlex.split(line, comments=True):
            if word in ENDS:
                found.append([])
            else:
                found[-1].append(word)
    return [words for words in found if words]
