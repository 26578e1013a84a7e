"""A name of a file cannot make a terminal do anything."""

import contextlib
import io
import logging
import sys

from rich.console import Console
from rich.markdown import Markdown
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from ico3d import cli
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


@contextlib.contextmanager
def terminal():
    """What a terminal gets of what is printed, by whatever means."""
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        guard_terminal()
        guard_terminal()  # one guard is enough
        yield stream


def test_warnings_of_readers_are_shown_so_line_by_line():
    record = logging.LogRecord("a", logging.WARNING, "", 0, "one\na\x1b]0;pwned\x9b", (), None)
    with terminal() as got:
        logging.lastResort.handle(record)
    assert got.getvalue() == "one\na\\x1b]0;pwned\\x9b\n"


def test_what_is_printed_is_shown_so_and_colours_stay():
    with terminal() as got:
        print(NAME.replace("\x1b[31m", ""), "\x1b[1;31mred\x1b[0m", file=sys.stderr)
        sys.stdout.writelines(["\x1b[2K\x1b[1A", "\x1b[8m", "\tä\n"])
    shown = SHOWN.replace(r"\x1b[31m", "")
    assert got.getvalue() == (
        f"{shown} \x1b[1;31mred\x1b[0m\n" + r"\x1b[2K\x1b[1A\x1b[8m" + "\tä\n"
    )


def test_what_rich_moves_stays_and_what_it_tells_is_shown_so():
    with terminal() as got, Progress(console=Console(force_terminal=True)) as bar:
        bar.advance(bar.add_task(NAME, total=1))
    assert SHOWN[:9] in got.getvalue() and "\x1b[?25l" in got.getvalue()
    assert "\x1b]" not in got.getvalue()


def test_traces_of_errors_are_shown_so():
    error = RuntimeError(NAME)
    with terminal() as got:
        sys.__excepthook__(RuntimeError, error, None)
    assert (
        got.getvalue().startswith(r"RuntimeError: a\x1b]0;pwned") and "\x9b" not in got.getvalue()
    )


def test_words_that_no_verb_takes_are_shown_so():
    with terminal() as got:
        for words in (["convert", "a.ply", "b.ply", NAME], [f"nosuch{NAME}"], ["measure", NAME]):
            with contextlib.suppress(SystemExit):
                cli.main(words)
    assert "pwned" in got.getvalue() and "\x1b]" not in got.getvalue()


def test_lone_surrogates_which_are_written_as_bytes_are_shown_so():
    name = "CC0\udcc2\udc9b8m"  # its bytes would be those of U+009B
    with terminal() as got:
        print(name)
        Console(file=sys.stdout, width=80).print(name, markup=False)
    assert got.getvalue() == "CC0\\udcc2\\udc9b8m\n" * 2
