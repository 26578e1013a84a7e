"""Figures for the operator of a server: metrics for Prometheus, and a log of turns.

They never contain words of visitors or ids of sessions; with an id, a conversation could be taken
over.
"""

import asyncio
import itertools
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from loguru import logger
from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    ProcessCollector,
    generate_latest,
)

from ico3d.chat.observing.figures_server import serve_figures
from ico3d.chat.observing.timing import Turn
from ico3d.errors import SettingsError

BUCKETS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.3, 2.0, 3.0, 5.0, 10.0)


class TurnLog:
    """A file with one line of JSON for each turn: times and counts only."""

    def __init__(self, file: TextIO):
        """Takes an open file; use `TurnLog.open`."""
        self._file, self._fails = file, False

    @classmethod
    def open(cls, path: Path) -> "TurnLog":
        """Opens a file for appending, or creates it.

        Raises:
            SettingsError: If the file cannot be written.
        """
        try:
            return cls(path.open("a", encoding="utf-8", buffering=1))
        except OSError as error:
            raise SettingsError(f"--log {path}: cannot be written ({error.strerror}).") from error

    def write(self, entry: dict) -> None:
        """Appends a line; where that fails, as on a full disk, it is said once."""
        try:
            self._file.write(json.dumps(entry) + "\n")
            self._fails = False
        except OSError as error:
            if not self._fails:
                logger.warning(f"--log cannot be written ({error.strerror}).")
            self._fails = True


class Monitor:
    """Counts the events of one server."""

    def __init__(self, log: TurnLog | None = None, today: Callable[[], datetime] | None = None):
        """Starts with all counts at 0.

        Args:
            log: Log of all turns, or None.
            today: Returns date and time, for the log.
        """
        self._log, self._today = log, today or (lambda: datetime.now(UTC))
        self._numbers = itertools.count(1)
        self._registry = registry = CollectorRegistry()
        ProcessCollector(registry=registry)
        self._parts = Histogram(
            "ico3d_turn_part_seconds",
            "From the end of a question to the first sound sent, by part.",
            ["part"],
            buckets=BUCKETS,
            registry=registry,
        )
        self._heard = Histogram(
            "ico3d_voice_to_voice_seconds",
            "From the end of a question to the first sound heard.",
            buckets=BUCKETS,
            registry=registry,
        )
        self._turns = Counter("ico3d_turns", "Questions answered.", ["kind"], registry=registry)
        self._interruptions = Counter(
            "ico3d_interruptions", "Answers that were stopped.", registry=registry
        )
        self._errors = Counter("ico3d_errors", "Errors by place.", ["where"], registry=registry)
        self._ended = Counter(
            "ico3d_sessions_ended", "Sessions by end.", ["why"], registry=registry
        )
        self._sessions = Gauge("ico3d_sessions", "Open sessions.", registry=registry)
        self.connections = Gauge("ico3d_connections", "Open connections.", registry=registry)
        self.waiting = Gauge("ico3d_waiting", "Visitors in the queue.", registry=registry)
        self._tasks = Gauge("ico3d_tasks", "Tasks of the event loop.", registry=registry)

    def watch(self, loop: asyncio.AbstractEventLoop) -> None:
        """Counts the tasks of an event loop from now on: a task that nobody ends is a leak."""
        self._tasks.set_function(lambda: len(asyncio.all_tasks(loop)))

    def visitor(self) -> "Visitor":
        """Counts a new session."""
        self._sessions.inc()
        return Visitor(self, next(self._numbers))

    def left(self, why: str) -> None:
        """Counts the end of a session."""
        self._sessions.dec()
        self._ended.labels(why).inc()

    def failed(self, where: str, cause: str = "") -> None:
        """Counts an error, and logs its cause for the operator if it is known.

        Args:
            where: Part of the conversation or of the server.
            cause: Cause without quotes of what was said.
        """
        self._errors.labels(where).inc()
        if cause:
            logger.error(f"{where} failed: {cause}")

    def turn(self, session: int, number: int, turn: Turn) -> None:
        """Counts a turn whose answer is over.

        Args:
            session: Number of the session.
            number: Number of the turn in the session.
            turn: Times of the turn's parts.
        """
        parts = turn.parts()
        for part, milliseconds in parts.items():
            self._parts.labels(part).observe(milliseconds / 1000)
        heard = turn.voice_to_voice()
        if heard is not None:
            self._heard.observe(heard / 1000)
        self._turns.labels("typed" if turn.typed else "spoken").inc()
        self._interruptions.inc(turn.interrupted)
        if self._log is not None:
            self._log.write(
                {
                    "time": self._today().isoformat(timespec="milliseconds"),
                    "session": session,
                    "turn": number,
                    "typed": turn.typed,
                    "parts_ms": {part: round(value, 1) for part, value in parts.items()},
                    "voice_to_voice_ms": None if heard is None else round(heard, 1),
                    "answer_seconds": round(turn.seconds, 2),
                    "interrupted": turn.interrupted,
                }
            )

    def exposition(self) -> bytes:
        """All figures in Prometheus' text format."""
        return generate_latest(self._registry)

    def publish(self, host: str, port: int) -> str:
        """Serves the figures in a thread, on a port of their own that visitors need not reach.

        Args:
            host: Address to listen on.
            port: Port to listen on; 0 takes any free port.

        Returns:
            Their URL.

        Raises:
            SettingsError: If the port cannot be opened.
        """
        try:
            found = serve_figures(self._registry, host, port)
        except OSError as error:
            raise SettingsError(
                f"port {port} on {host} cannot be used for figures ({error.strerror}): "
                "choose another one with --metrics-port."
            ) from error
        shown = f"[{host}]" if ":" in host else host
        return f"http://{shown}:{found}/metrics"


class Visitor:
    """One session, known to the monitor only by a number."""

    def __init__(self, monitor: Monitor, number: int):
        """Created by `Monitor.visitor`."""
        self._monitor, self._number = monitor, number
        self._turns = itertools.count(1)

    def turn(self, turn: Turn) -> None:
        """Counts a turn of this session."""
        self._monitor.turn(self._number, next(self._turns), turn)

    def failed(self, where: str, cause: str) -> None:
        """Counts an error of this session; `cause` must not quote what was said."""
        self._monitor.failed(where, f"{cause} [session {self._number}]")
