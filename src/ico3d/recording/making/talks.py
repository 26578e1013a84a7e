"""Starts and stops the servers of finished avatars."""

import os
import re
import subprocess
import threading
from concurrent.futures import Future
from pathlib import Path

from ico3d.recording.beside import start, stop
from ico3d.recording.refusals import Refused

TALK = "ico3d.recording.making.talk"
MOST = 4
"""Servers at once, of 150 MB each; of more, the one that was asked for longest ago ends."""
PATIENCE = 0.5
"""Seconds in which a talk may end by itself: the sentence at hand would take longer."""
TOLD = re.compile(rb".* is at (https?://\S+) \(Ctrl\+C ends\)$")
"""The line in which a server tells its address, behind a name that may be anybody's."""


class Talks:
    """Servers of finished avatars, as `ico3d serve` starts them, one for each, and few at once."""

    def __init__(self, host: str, tls: bool):
        """Serves on the address `host`, by HTTPS if wanted."""
        self._words = [host, "tls" if tls else "plain"]
        self._running: dict[str, Talk] = {}
        self._lock = threading.Lock()

    def begin(self, avatar: Path) -> "Talk":
        """The server of an avatar, which is started where there is none.

        Nobody waits until it has started but who asks for its address.

        Raises:
            Refused: If the avatar is not made.
        """
        _check(avatar)
        with self._lock:
            talk = self._running.pop(avatar.stem, None)
            if talk is None or talk.process.poll() is not None:
                process = start(TALK, [str(avatar), *self._words], subprocess.PIPE)
                talk = Talk(avatar.name, process)
            self._running[avatar.stem] = talk  # the one that was asked for last is the last
            over = list(self._running)[:-MOST]
        for name in over:
            self.stop(name)
        try:
            _check(avatar)  # who deletes it stops talks afterwards: one of both sees the other
        except Refused:
            self.stop(avatar.stem)
            raise
        return talk

    def stop(self, name: str) -> None:
        """Ends the server of somebody's avatar, if there is one, even as it starts."""
        with self._lock:
            talk = self._running.pop(name, None)
        if talk is not None:  # others need not wait until it is gone
            stop(talk.process, PATIENCE)

    def close(self) -> None:
        """Ends all servers."""
        for name in list(self._running):
            self.stop(name)


def _check(avatar: Path) -> None:
    """Raises `Refused` where an avatar is not there."""
    if os.path.islink(avatar) or not os.path.isfile(avatar):
        raise Refused("unmade", "the avatar is not made yet.", 409)


class Talk:
    """The server of one avatar.

    Attributes:
        process: Its process.
    """

    def __init__(self, name: str, process: subprocess.Popen[bytes]):
        """Reads what a process prints.

        Args:
            name: The file of the avatar.
            process: What serves it, just started.
        """
        self.process = process
        self._name = name
        self._url: Future[str] = Future()
        threading.Thread(target=self._read, daemon=True).start()

    def url(self) -> str:
        """Address of the page on which the avatar talks, which the server tells after seconds.

        Raises:
            Refused: If it cannot be served, or was stopped before.
        """
        if url := self._url.result():
            return url
        stop(self.process)
        raise Refused("silent", f"the avatar cannot talk: ico3d serve {self._name}.", 500)

    def _read(self) -> None:
        """Reads what is printed to its end: a full pipe would stop the server."""
        assert self.process.stdout is not None
        with self.process.stdout as printed:
            for line in printed:
                found = TOLD.search(line.rstrip())
                if found and not self._url.done():
                    self._url.set_result(found[1].decode())
        if not self._url.done():
            self._url.set_result("")
