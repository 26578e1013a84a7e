"""Reads the commands of a guide and runs them."""

import re
import shlex
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ico3d import cli

GUIDES = Path(__file__).parents[2] / "docs" / "guides"
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
    """Serves, in this process, until the avatar was seen once."""
    from ico3d.chat.serving import server

    made, seen = server.make_server, []

    def with_a_visitor(*served):
        running = made(*served)
        threading.Thread(target=_look, args=(running, seen), daemon=True).start()
        return running

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "make_server", with_a_visitor)
        assert cli.main(words) == 0, f"{words} served nothing"
    assert b"ico3d-bundle" in seen[0]


def _look(running: Any, seen: list[bytes]) -> None:
    """Reads what a server that is about to start says of its avatar, and ends it."""
    try:
        while not running.started:
            time.sleep(0.01)
        host, port = running.servers[0].sockets[0].getsockname()
        url = f"http://{host}:{port}/bundle/manifest.json"
        with urllib.request.urlopen(url, timeout=30) as answer:
            seen.append(answer.read())
    finally:
        running.should_exit = True
