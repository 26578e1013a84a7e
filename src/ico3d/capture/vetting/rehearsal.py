"""Opens a video in a process of its own first, where limits end what would cost too much.

While FFmpeg opens a file, nothing stops it from within the process: it searches the names of tags
one by one, believes tables, and decodes pictures of every track. A file of 300 kB can keep it for
minutes, or take gigabytes. What was opened there costs no more here.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ico3d.common.unpacking.limits import limit_addresses, limit_seconds, taken
from ico3d.errors import CaptureError

MOST_SECONDS = 5
"""Of processor time: films of two hours take 0.3 s, pictures of 8192 × 4320 pixels 1 s."""
MOST_BYTES = 1 << 30
"""Of memory: films of two hours take 60 MB, pictures of 8192 × 4320 pixels 500 MB."""
LARGEST_PIECE = (2 << 30) + (1 << 20)
"""Bytes that FFmpeg asks for at once, at most.

There is as much room above `MOST_BYTES`, as FFmpeg goes on without some pieces that it is refused:
so none is that counts.
"""
PATIENCE = 60.0
"""Seconds by the clock, as on a slow disk."""
COSTLY = 3
"""Exit status of the process where a file takes too much memory; too much time kills it."""
MOST_REMEMBERED = 1024
"""Files of which it is remembered that they were opened."""


def rehearse(path: Path, how: Mapping[str, Any]) -> None:
    """Opens a file in another process, as it is to be opened here, and decodes its first picture.

    A file that has not changed since is not opened there again. Systems without such limits open it
    here at once.

    Args:
        path: A file of anybody.
        how: What `av.open` is told of it, as JSON can hold it.

    Raises:
        CaptureError: If that takes more time or memory than videos do.
        OSError: If the file is not there, or no process can be started.
    """
    if find_spec("resource") is None:
        return
    about = path.stat()
    state = (about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns, about.st_ctime_ns)
    _rehearse(os.fspath(path), json.dumps(how), state)


@lru_cache(MOST_REMEMBERED)  # of what is raised, nothing is remembered
def _rehearse(path: str, how: str, state: tuple[int, ...]) -> None:
    """What `rehearse` does, once for each state of a file."""
    del state
    limits = str(MOST_SECONDS), str(MOST_BYTES)
    command = (sys.executable, "-P", "-m", __name__, path, how, *limits)
    none, status = subprocess.DEVNULL, COSTLY
    with suppress(subprocess.TimeoutExpired):  # by then it was killed
        status = subprocess.run(
            command, stdin=none, stdout=none, stderr=none, timeout=PATIENCE
        ).returncode
    if status == COSTLY or status < 0:
        raise CaptureError.of("costly", f"{path}: ")
    if status:
        raise OSError(f"{path} is opened by another process first, and {sys.executable} fails")


def _main(path: str, how: str, seconds: str, bytes: str) -> int:
    """What the other process does; its exit status is 0 if the file may be opened.

    So it is for a file that cannot be opened: that is found again at the same cost.
    """
    import av

    options, before = json.loads(how), taken("VmPeak")
    limit_seconds(int(seconds))
    if before:
        limit_addresses(before + int(bytes) + LARGEST_PIECE)
    with suppress(Exception), av.open(path, **options) as container:
        for stream in container.streams.video[:1]:
            stream.codec_context.options = options["options"]
            stream.codec_context.thread_count = 1  # threads would take memory for themselves
            next(container.decode(stream), None)
    return COSTLY if taken("VmPeak") - before > int(bytes) else 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
