"""Looks at each part in a process of its own, which ends where the part takes too much.

A few megabytes can keep FFmpeg for hours or fill the memory, and nothing stops it from within a
process; a damaged file may end it.
"""

import asyncio
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from ico3d.common.typed import plain
from ico3d.common.unpacking.limits import limit_memory, limit_seconds
from ico3d.creating.looking.advice import Advice
from ico3d.errors import CaptureError
from ico3d.recording.beside import end_with_parent, start, stop
from ico3d.recording.guiding.seeing import Eye
from ico3d.recording.refusals import Refused, costly, nothing_arrived

LOOK = "ico3d.recording.guiding.looking"
MOST_AT_ONCE = 2
"""Parts that are looked at at a time; others wait."""
SECONDS, SECONDS_PER_MEGABYTE = 120.0, 30.0
"""Processor time that a look may take: recordings take 2 s per megabyte, those of 70 kbit/s, in
which faces are sought as often, 14."""
MOST_BYTES = 4 << 30
"""Memory that a look may take besides the tracker: two hours of sound take 0.5 GB, pictures of
8192 × 4320 pixels 0.1 GB each, and one is decoded on each processor."""
SLOWEST = 20.0
"""Seconds by the clock in which a second of processor time is had, on the busiest machine."""


class Looks:
    """Processes that look at parts, as many as are asked for."""

    def __init__(self):
        """Starts none yet."""
        self._is_closed = False
        self._running: dict[subprocess.Popen[bytes], Path] = {}

    async def report(self, file: Path, id: str) -> dict[str, Any]:
        """What is found in a part, as `Eye.report` tells it.

        Args:
            file: The recording.
            id: The part.

        Raises:
            Refused: As `Eye.report`, or if it takes too much time or memory, or was deleted.
            CaptureError: If the process fails, or the looks have been ended.
        """
        return await asyncio.to_thread(self._report, file, id)

    def close(self) -> None:
        """Ends the looks that go on, and those that would follow."""
        self._is_closed = True
        for process in list(self._running):
            stop(process)

    def end(self, folder: Path) -> None:
        """Ends the looks at parts in a folder that is gone: until then their bytes are held."""
        for process, file in list(self._running.items()):
            if file.is_relative_to(folder):
                stop(process)

    def _report(self, file: Path, id: str) -> dict[str, Any]:
        try:
            size = file.stat().st_size
        except FileNotFoundError as error:
            raise nothing_arrived() from error
        seconds = SECONDS + SECONDS_PER_MEGABYTE * size / 1e6
        words = [str(file), id, str(seconds), str(MOST_BYTES)]
        process = start(LOOK, words, subprocess.PIPE, errors=None)
        self._running[process] = file
        slow = threading.Timer(SLOWEST * seconds, process.kill)
        slow.start()
        if self._is_closed or not os.path.exists(file):  # the end came before the process was known
            process.kill()
        try:
            assert process.stdout is not None
            with process.stdout as printed:
                told = printed.read()
            status = process.wait()
        finally:
            slow.cancel()
            del self._running[process]
            stop(process)
        if self._is_closed:
            raise CaptureError(f"{file.name}: the server ended while it was looked at.")
        if status < 0:
            raise costly() if os.path.exists(file) else nothing_arrived()
        if status:
            raise CaptureError(f"{file.name}: the process that looks at parts has failed.")
        return _answer(json.loads(told))


def _answer(told: dict[str, Any]) -> dict[str, Any]:
    """The report that a process tells.

    Raises:
        Refused: If it refuses the part.
    """
    if "report" in told:
        return told["report"]
    code, text, status, advice = told["refused"]
    raise Refused(code, text, status, [Advice(**one) for one in advice])


def _look(file: str, id: str, seconds: str, bytes: str) -> None:
    """What the process does."""
    end_with_parent()
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    eye = Eye()
    limit_seconds(float(seconds))
    limit_memory(int(bytes))
    try:
        told: dict[str, Any] = {"report": eye.report(Path(file), id)}
    except MemoryError:
        told = {"refused": _plain(costly())}
    except Refused as error:
        told = {"refused": _plain(error)}
    json.dump(told, answer)
    answer.flush()
    os._exit(0)  # libraries' threads may not end


def _plain(error: Refused) -> list[Any]:
    """A refusal as JSON can hold it."""
    return [error.code, str(error), error.status, plain(error.advice)]


if __name__ == "__main__":
    _look(*sys.argv[1:])
