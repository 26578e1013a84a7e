"""Reads the commands of a guide and runs them."""

import re
import shlex
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ico3d import cli

GUIDES = Path(__file__).parents[2] / "docs" / "guides"
PATIENCE = 60
"""Seconds until a server must answer."""
BLOCK = re.compile(r"^```bash\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"^```toml\n(# (\S+)\n.*?)^```$", re.MULTILINE | re.DOTALL)
OTHERS = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def commands(name: str) -> list[list[str]]:
    """The words of every command in the bash blocks of a guide, in order; comments left out."""
    text = (GUIDES / name).read_text("utf-8")
    lines = "".join(BLOCK.findall(text)).replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def write_files(name: str) -> list[str]:
    """Writes the files that a guide shows into the current folder; their names in order.

    The first line of each is its name.
    """
    text = (GUIDES / name).read_text("utf-8")
    shown = FILE.findall(text)
    assert len(shown) == text.count("```toml"), f"{name} shows a file without a name"
    for content, file in shown:
        Path(file).write_text(content, "utf-8")
    return [file for _, file in shown]


def other_commands(name: str) -> list[str]:
    """The lines of a guide's sh blocks: programs besides ico3d, and what needs a network."""
    return "".join(OTHERS.findall((GUIDES / name).read_text("utf-8"))).splitlines()


def parsed(words: list[str]) -> Any:
    """The settings that a command's words mean; nothing is run."""
    verb = verb_of(words)
    return cli.parsed(verb, words[1 + len(verb.split()) :])


def verb_of(words: list[str]) -> str:
    """Which verb of ico3d a command is.

    Raises:
        AssertionError: If it is none: then the guide would not work.
    """
    assert words[0] == "ico3d", f"guides hold commands of ico3d alone, not {words[0]}"
    verb = cli.verb_of(words[1:])
    assert verb is not None, f"there is no verb {words[1:3]}"
    return verb


def follow(
    name: str, small: dict[str, str], instead: dict[str, Callable[[list[str]], None]] | None = None
) -> None:
    """Runs a guide in the current folder.

    Args:
        name: Of the guide's file.
        small: Words to put behind the commands of a verb.
        instead: What to do in the place of verbs that cannot run here.
    """
    for words in commands(name):
        verb = verb_of(words)
        if instead and verb in instead:
            instead[verb](words)
        elif verb == "serve":
            _visit([*words[1:], *small[verb].split()])
        else:
            print("+", shlex.join(words), flush=True)
            assert cli.main([*words[1:], *small.get(verb, "").split()]) == 0, shlex.join(words)


def _visit(words: list[str]) -> None:
    """Serves until the avatar was seen once."""
    command = [sys.executable, "-m", "ico3d.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            url = re.search(r"http://[\d.]+:\d+", server.stdout.readline())
            assert url is not None, f"{words} served nothing"
            assert b"ico3d-bundle" in _fetched(f"{url[0]}/bundle/manifest.json")
        finally:
            server.terminate()


def _fetched(url: str) -> bytes:
    """The answer of a server that is about to start."""
    for _ in range(PATIENCE):
        try:
            with urllib.request.urlopen(url, timeout=30) as answer:
                return answer.read()
        except urllib.error.URLError:
            time.sleep(1)
    raise AssertionError(f"{url} did not answer in {PATIENCE} s")
