"""Starts and stops the servers of finished avatars."""

import os
import re
import subprocess
import threading
from pathlib import Path
from typing import IO

from ico3d.recording.beside import start, stop
from ico3d.recording.refusals import Refused

TALK = "ico3d.recording.making.talk"
MOST = 4
"""Servers at once, of 150 MB each; of more, the one that was asked for longest ago ends."""
PATIENCE = 0.5
"""Seconds in which a talk may end by itself: the sentence at hand would take longer."""


class Talks:
    """Servers of finished avatars, as `ico3d serve` starts them, one for each, and few at once."""

    def __init__(self, host: str, tls: bool):
        """Serves on the address `host`, by HTTPS if wanted."""
        self._words = [host, "tls" if tls else "plain"]
        self._running: dict[str, tuple[subprocess.Popen[bytes], str]] = {}
        self._lock = threading.Lock()

    def url(self, avatar: Path) -> str:
        """Address of the page on which an avatar talks; its server is started where there is none.

        Raises:
            Refused: If the avatar is not made, or cannot be served.
        """
        if os.path.islink(avatar) or not os.path.isfile(avatar):
            raise Refused("unmade", "the avatar is not made yet.", 409)
        with self._lock:
            process, url = self._running.pop(avatar.stem, (None, ""))
            if process is None or process.poll() is not None:
                process, url = self._started(avatar)
            self._running[avatar.stem] = process, url  # the one that was asked for last is the last
            over = list(self._running)[:-MOST]
        for name in over:
            self.stop(name)
        return url

    def _started(self, avatar: Path) -> tuple[subprocess.Popen[bytes], str]:
        """A new server, with its address."""
        process = start(TALK, [str(avatar), *self._words], subprocess.PIPE)
        url = _read_url(process)
        if not url:
            stop(process)
            raise Refused("silent", f"the avatar cannot talk: ico3d serve {avatar.name}.", 500)
        return process, url

    def stop(self, name: str) -> None:
        """Ends the server of somebody's avatar, if there is one."""
        with self._lock:
            process, _ = self._running.pop(name, (None, ""))
        if process is not None:  # others need not wait until it is gone
            stop(process, PATIENCE)

    def close(self) -> None:
        """Ends all servers."""
        for name in list(self._running):
            self.stop(name)


TOLD = re.compile(rb".* is at (https?://\S+) \(Ctrl\+C ends\)$")
"""The line in which a server tells its address, behind a name that may be anybody's."""


def _read_url(process: subprocess.Popen[bytes]) -> str:
    """The address that a server prints; empty if it ends without one."""
    assert process.stdout is not None
    for line in map(bytes.rstrip, process.stdout):
        found = TOLD.search(line)
        if found:
            threading.Thread(target=_drain, args=(process.stdout,), daemon=True).start()
            return found[1].decode()
    process.stdout.close()
    return ""


def _drain(out: IO[bytes]) -> None:
    """Reads what is printed to its end: a full pipe would stop the server."""
    with out as printed:
        for _ in printed:
            pass
