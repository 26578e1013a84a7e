"""The operator's log on the standard error stream, without words of visitors.

Messages of ico3d's own code are shown in full, because that code quotes nobody (`failures.py`).
Messages of other packages may contain a question, an answer or a whole request. Of these only the
constant part is shown, as it stands in the source code of the logging call, and numbers, which
quote nobody either.
"""

import ast
import functools
import json
import linecache
import logging
import re
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TextIO

from ico3d.chat.observing.failures import cause
from ico3d.errors import MissingExtraError, SettingsError, printable

if TYPE_CHECKING:
    from loguru import Message, Record

OWN = "ico3d."
TOLD = (  # places where pipecat logs the errors of processors, of which `metrics.py` tells
    ("pipecat.processors.frame_processor", "push_error_frame"),
    ("pipecat.pipeline.worker", "_source_push_frame"),
    ("pipecat.pipeline.worker", "_handle_unusable_processor"),
)
QUIET = 60.0  # s for which a line that has just been written is not written again
MOST = 200  # lines that are remembered for it
PLACEHOLDER = re.compile(r"%(?:\((?P<name>[^)]*)\))?[-#0 +]*[\d*]*(?:\.[\d*]+)?[a-zA-Z%]")
LOGGING_CALL_LINES = 12  # source lines that one call of a logger takes at most


class OperatorLog:
    """Writes lines; repetitions are counted instead of written again."""

    def __init__(
        self,
        file: TextIO | None = None,
        now: Callable[[], float] = time.monotonic,
        as_json: bool = False,
    ):
        """Starts without lines.

        Args:
            file: Where to write, by default to the current standard error stream.
            now: Returns the time in seconds.
            as_json: Whether a line is an object of JSON.
        """
        self._file, self._now = file, now
        self._form = as_object if as_json else as_text
        self._seen: dict[str, tuple[float, int]] = {}  # when a line was written, how often since

    def write(self, level: str, line: str) -> None:
        """Writes a line, unless the same line was written recently."""
        now = self._now()
        since, more = self._seen.pop(line, (-QUIET, 0))
        if now - since < QUIET:
            self._seen[line] = since, more + 1
            return
        self._seen[line] = now, 0
        while len(self._seen) > MOST:
            del self._seen[next(iter(self._seen))]
        with suppress(OSError):  # a full disk loses lines, not conversations
            print(self._form(level, line, more), file=self._file or sys.stderr, flush=True)

    def take(self, message: "Message") -> None:
        """Handles a record of loguru, of ico3d or pipecat."""
        record = message.record
        name, place = record["name"] or "", (record["name"], record["function"])
        if name.startswith(OWN):
            self.write(record["level"].name, record["message"])
        elif place not in TOLD and record["function"] != "<module>":  # a package that is missing
            said = constant_part(record["file"].path, record["line"])
            exception = record["exception"]
            self.write(
                record["level"].name,
                _line(f"{name}.{record['function']}", said, exception.value if exception else None),
            )


def as_text(level: str, line: str, more: int) -> str:
    """A line of the log for people; `more` is how often it was left out before.

    A terminal obeys nothing in it, and it is one line: parts of it may come from other servers.
    """
    again = f" ({more} more of these since)" if more else ""
    return f"{time.strftime('%H:%M:%S')} {level}: {printable(line)}{again}"


def as_object(level: str, line: str, more: int) -> str:
    """A line of the log for programs: an object of JSON."""
    when = datetime.now(UTC).isoformat(timespec="milliseconds")
    return json.dumps({"time": when, "level": level, "message": line, "left_out": more})


class StandardHandler(logging.Handler):
    """Handles records of Python's `logging`: of uvicorn, asyncio and clients."""

    def __init__(self, log: OperatorLog):
        """Handles warnings and errors."""
        super().__init__(logging.WARNING)
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        """Writes a record: in full if it is ico3d's, else its constant part and numbers."""
        own = record.name.startswith(OWN)
        constant = "" if own else constant_part(record.pathname, record.lineno)
        said = record.getMessage() if own else filled(constant, record.args)
        error = record.exc_info[1] if record.exc_info else None
        self._log.write(record.levelname, _line(record.name, said, error))


def set_up_log(verbose: bool, as_json: bool = False) -> None:
    """Shows warnings and errors on the standard error stream; if verbose, everything said, too.

    Args:
        verbose: Whether to show everything, in the libraries' own form.
        as_json: Whether a line is an object of JSON.

    Raises:
        MissingExtraError: If the extra `chat` is not installed.
        SettingsError: If both are asked for.
    """
    if verbose and as_json:
        raise SettingsError("--verbose has a form of its own: leave --json-log out.")
    try:
        from loguru import logger
    except ImportError:
        raise MissingExtraError("pipecat-ai", "chat", "talking with an avatar") from None
    logger.remove()
    if verbose:
        logger.configure(patcher=_make_printable)
        logger.add(sys.stderr, level="DEBUG")
        logging.basicConfig(level=logging.INFO)
        return
    log = OperatorLog(as_json=as_json)
    logger.add(log.take, level="WARNING", format="{message}")
    logging.getLogger().addHandler(StandardHandler(log))


def _make_printable(record: "Record") -> None:
    record["message"] = printable(record["message"])


def constant_part(path: str, line: int) -> str:
    """The constant part of a logging call in the source, with … for filled-in values; or ""."""
    for node in ast.walk(_call(path, line) or ast.Pass()):
        if isinstance(node, ast.Call) and node.args:
            return _constant(node.args[0])
    return ""


def filled(said: str, values: object) -> str:
    """A message of `logging` with its numbers filled in, and … for all other values.

    Args:
        said: The message with placeholders such as `%s`.
        values: A record's `args`: a tuple, a mapping, or nothing, which leaves the message as it
            is.
    """
    if not values:
        return said
    named = values if isinstance(values, Mapping) else {}
    rest = iter(values if isinstance(values, tuple) else ())

    def one(place: re.Match[str]) -> str:
        if place[0].endswith("%"):
            return "%"
        for _ in range(place[0].count("*")):  # widths that are values themselves
            next(rest, None)
        value = next(rest, None) if place["name"] is None else named.get(place["name"])
        if not isinstance(value, int | float):
            return "…"
        return f"{value:g}" if isinstance(value, float) else str(value)

    return PLACEHOLDER.sub(one, said)


@functools.cache
def _call(path: str, line: int) -> ast.AST | None:
    """The statement that begins in a line of a source file."""
    source = ""
    for number in range(line, line + LOGGING_CALL_LINES):
        source += linecache.getline(path, number).lstrip() if number == line else ""
        source += linecache.getline(path, number) if number > line else ""
        try:
            return ast.parse(source)
        except SyntaxError:
            continue
    return None


def _constant(message: ast.expr) -> str:
    if isinstance(message, ast.Constant) and isinstance(message.value, str):
        return message.value
    if isinstance(message, ast.JoinedStr):
        return "".join(_constant(part) for part in message.values)
    return "…" if isinstance(message, ast.FormattedValue) else ""


def _line(place: str, said: str, error: BaseException | None) -> str:
    parts = [place, " ".join(said.split()), cause(error) if error else ""]
    return ": ".join(part for part in parts if part.strip("… :"))
