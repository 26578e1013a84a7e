"""Keeps a run to one process at a time; the lock ends with the process, however that ends."""

import fcntl
import os
import time
from pathlib import Path
from weakref import WeakValueDictionary

from ico3d.errors import SettingsError

PATIENCE = 5.0
"""Seconds within which a process that was killed, or a look at the lock, lets it go."""
_PAUSE = 0.05


class Lock:
    """A file that this process alone has locked, as long as the object lives."""

    def __init__(self, file: Path):
        """Locks a file that exists.

        Where a file system knows no locks, nothing is locked.

        Raises:
            SettingsError: If another process holds the lock, and keeps it.
        """
        self._file = file.open("r+b")
        until = time.monotonic() + PATIENCE
        while True:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            except BlockingIOError:
                if time.monotonic() >= until:
                    self._file.close()
                    raise SettingsError(
                        f"{file.parent} is being trained just now, by another process: wait for "
                        "its end, or end it."
                    ) from None
            except OSError:
                return
            time.sleep(_PAUSE)

    def __del__(self):
        """Lets go."""
        self._file.close()


_HELD: WeakValueDictionary[tuple[int, int], Lock] = WeakValueDictionary()
"""What this process has locked, by device and inode."""


def locked(file: Path) -> Lock:
    """The lock of a file; within one process everybody gets the same one.

    Raises:
        SettingsError: If another process holds it.
    """
    about = os.stat(file)
    key = about.st_dev, about.st_ino
    held = _HELD.get(key)
    if held is None:
        held = _HELD[key] = Lock(file)
    return held


def is_locked(file: Path) -> bool:
    """Whether a process holds the lock of a file; False where there is no such file."""
    try:
        with file.open("rb") as opened:
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False
