"""Kills the process that makes somebody's avatar, as systems do when memory runs out.

Run: python killed.py FOLDER
"""

import os
import signal
import sys
import time
from pathlib import Path

WORKER = "ico3d.recording.making.worker"
"""As in `ico3d.recording.making.makers`, whose import would take too long."""


def makers_of(folder: str) -> list[int]:
    """Processes that make the avatar of a folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue  # it has ended meanwhile
        if WORKER in words and folder in words:
            found.append(int(entry.name))
    return found


def main() -> int:
    """Does what the file's docstring says; the exit status."""
    (folder,) = sys.argv[1:]
    end = time.monotonic() + 100
    while not (processes := makers_of(folder)):
        if time.monotonic() > end:
            return 1
        time.sleep(0.05)
    for process in processes:
        os.kill(process, signal.SIGKILL)
    return 0


if __name__ == "__main__":
    sys.exit(main())
