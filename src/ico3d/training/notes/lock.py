"""Keeps a run to one process at a time; the lock ends with the process, however that ends."""

import fcntl
import os
import time
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar
from weakref import WeakValueDictionary

from ico3d.errors import SettingsError

PATIENCE = 5.0
"""Seconds within which a process that was killed, or a look at the lock, lets it go."""
_PAUSE = 0.05
P = ParamSpec("P")
T = TypeVar("T")


class Lock:
    """A file that this process alone has locked, until it lets go or the object is collected."""

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

    @property
    def is_held(self) -> bool:
        """Whether it was not let go."""
        return not self._file.closed

    def let_go(self) -> None:
        """Others may work there."""
        self._file.close()

    def __del__(self):
        """Nobody knows it any more."""
        self._file.close()


_HELD: WeakValueDictionary[tuple[int, int], Lock] = WeakValueDictionary()
"""What this process has locked, by device and inode."""
_TAKEN: ContextVar[list[Lock] | None] = ContextVar("taken", default=None)
"""The locks that were taken since `lets_go` began to watch."""


def locked(file: Path) -> Lock:
    """The lock of a file; within one process everybody gets the same one.

    Raises:
        SettingsError: If another process holds it.
    """
    about = os.stat(file)
    key = about.st_dev, about.st_ino
    held = _HELD.get(key)
    if held is None or not held.is_held:
        held = _HELD[key] = Lock(file)
        taken = _TAKEN.get()
        if taken is not None:
            taken.append(held)
    return held


def lets_go(train: Callable[P, T]) -> Callable[P, T]:
    """Makes a function let all locks go in the end that it took.

    Without, an error that somebody keeps would keep the frames that hold the locks.
    """

    @wraps(train)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> T:
        taken: list[Lock] = []
        token = _TAKEN.set(taken)
        try:
            return train(*args, **kwargs)
        finally:
            _TAKEN.reset(token)
            for lock in taken:
                lock.let_go()

    return wrapped


def is_locked(file: Path) -> bool:
    """Whether a process holds the lock of a file or folder; False where there is none."""
    if not (os.path.isfile(file) or os.path.isdir(file)):  # nobody opens a pipe on the other side
        return False
    try:
        opened = os.open(file, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    finally:
        os.close(opened)
    return False
