"""A name of a file cannot make a terminal do anything."""

import io
import logging
import sys

from rich.console import Console
from rich.markdown import Markdown
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from ico3d.common.terminal import guard_terminal

NAME = "a\x1b]0;pwned\x1b\\\x1b[31mred\x9b8m\u202egpj.exe"
SHOWN = r"a\x1b]0;pwned\x1b\\x1b[31mred\x9b8m\u202egpj.exe"


def printed(shown) -> str:
    """What a terminal with colours gets."""
    stream = io.StringIO()
    Console(file=stream, force_terminal=True, width=200, highlight=False).print(shown, markup=False)
    return stream.getvalue()


def test_names_are_shown_with_escapes_wherever_rich_prints_them():
    guard_terminal()
    table = Table("head", title=Text(NAME))
    table.add_row(Text(NAME, "red"))
    for shown in (NAME, Text(NAME, "green"), table, Markdown(f"# {NAME}")):
        text = printed(shown)
        assert SHOWN in text and "\x1b]" not in text and "\x9b" not in text
    assert "\x1b[32m" in printed(Text("good", "green"))  # colours stay
    assert printed("two\nlines\tare two") == "two\nlines   are two\n"


def test_progress_bars_move_as_before():
    guard_terminal()
    stream = io.StringIO()
    with Progress(console=Console(file=stream, force_terminal=True)) as bar:
        bar.advance(bar.add_task(NAME, total=1))
    assert SHOWN[:9] in stream.getvalue() and "\x1b[?25l" in stream.getvalue()


def test_warnings_of_readers_are_shown_so_line_by_line(monkeypatch):
    guard_terminal()
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    record = logging.LogRecord("a", logging.WARNING, "", 0, f"one\n{NAME}", (), None)
    logging.lastResort.handle(record)
    assert sys.stderr.getvalue() == f"one\n{SHOWN}\n"
