"""How long an avatar of a recording takes on this machine, before anybody begins to make it."""

import logging
import math
import re
import subprocess
import threading
from collections.abc import Callable, Mapping

from ico3d.creating.plan import expected
from ico3d.creating.settings import QUALITIES, QualityName
from ico3d.recording.beside import start, stop
from ico3d.recording.making.pace import SAID
from ico3d.recording.making.sources import Recorded

PACE = "ico3d.recording.making.pace"
AGAIN = 5.0
"""Seconds between two looks whether the machine is free to be measured."""
log = logging.getLogger(__name__)


class Durations:
    """Knows how fast the machine is, once that was measured in the background."""

    def __init__(self, is_busy: Callable[[], bool], pace: str = PACE):
        """Measures nothing yet.

        Args:
            is_busy: Whether an avatar is being made, which would make the machine seem slow.
            pace: The module of the process that measures.
        """
        self._is_busy, self._pace = is_busy, pace
        self._step: float | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._ended, self._lock = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._measure, daemon=True)

    def begin(self) -> None:
        """Begins to measure in the background, as soon as nothing is being made."""
        self._thread.start()

    def of(self, recorded: Recorded) -> Mapping[QualityName, float]:
        """Expected seconds of each quality for what is recorded.

        Empty where nothing is, or as long as nobody knows how fast the machine is.
        """
        seconds, step = recorded.seconds, self._step
        if step is None or not seconds:
            return {}
        return {name: sum(expected(one, seconds, step).values()) for name, one in QUALITIES.items()}

    def close(self) -> None:
        """Ends the measuring, if it goes on."""
        self._ended.set()
        with self._lock:
            if self._process is not None:
                self._process.terminate()
        if self._thread.is_alive():
            self._thread.join()

    def _measure(self) -> None:
        while self._is_busy():
            if self._ended.wait(AGAIN):
                return
        with self._lock:
            if self._ended.is_set():
                return
            self._process = start(self._pace, [], subprocess.PIPE)
        assert self._process.stdout is not None
        with self._process.stdout as out:
            printed = out.read().decode(errors="replace")
        stop(self._process)
        self._step = _step_in(printed)
        if self._step is None and not self._ended.is_set():
            log.warning("how long avatars take is not shown: %s", printed.strip()[-200:])


def _step_in(printed: str) -> float | None:
    """The seconds of a step that a process has printed; None if there are none."""
    found = re.search(rf"^{SAID} (\d+(?:\.\d+)?)$", printed, re.MULTILINE)
    step = float(found[1]) if found else math.nan
    return step if 0 < step < math.inf else None
