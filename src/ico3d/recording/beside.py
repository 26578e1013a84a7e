"""Processes beside the server that end with it.

They are started with a pipe as standard input; when the server ends, even if it is killed, the pipe
closes, and they end.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import IO

FULL_DISK = 74
"""Exit status of a process that ends because the disk is full, and may not be able to note it."""
PATIENCE = 5.0
"""Seconds in which most processes may end by themselves."""


def end_with_parent() -> None:
    """Ends this process, and those that it started, when its standard input closes."""

    def wait() -> None:
        with contextlib.suppress(OSError):
            while os.read(0, 4096):  # not by sys.stdin, whose lock would abort an ending process
                pass
        os.killpg(0, signal.SIGKILL)

    threading.Thread(target=wait, daemon=True).start()


def start(
    module: str,
    words: Sequence[str],
    out: IO[bytes] | int,
    errors: IO[bytes] | int | None = subprocess.STDOUT,
) -> subprocess.Popen[bytes]:
    """Starts a module of ico3d in a process group of its own.

    It imports nothing from the folder in which the server was started (`-P`).

    Args:
        module: Its name.
        words: Its arguments.
        out: What takes its output.
        errors: What takes its errors: by default what takes its output, or None for the server's.
    """
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *words],
        stdin=subprocess.PIPE,
        stdout=out,
        stderr=errors,
        start_new_session=True,
    )


def stop(process: subprocess.Popen[bytes], patience: float = PATIENCE) -> None:
    """Ends a process and all that it started; returns when it is gone.

    Its output stays open for whoever reads it, perhaps in another thread, and closes it.

    Args:
        process: What `start` has started.
        patience: Seconds in which it may end by itself before it is killed.
    """
    if process.poll() is None:
        try:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(patience)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            process.kill()
        process.wait()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin is not None:
        process.stdin.close()
