"""Programs in processes of their own, for libraries that a text may end.

A module is such a program if it ends with `serve(answer)`: it is run by `python -m` and answers one
request after the other. Nothing that is slow to import is imported here.
"""

import atexit
import contextlib
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import Any

_LENGTH = struct.Struct("<I")
_ANSWER = struct.Struct("<II")
_PIECE = 1 << 16  # bytes that are read at once: what a pipe holds

Told = tuple[dict[str, Any], bytes]
"""What is told in words and numbers, and in bytes."""


class LostError(Exception):
    """The process has ended in the middle of a request; the next one starts another."""


class RefusedError(Exception):
    """The request cannot be answered; the message is a sentence that says why."""


class Isolated:
    """A program in a process of its own, for which threads wait in turn."""

    def __init__(self, module: str, longest: float):
        """Starts no process yet; the first request does.

        Args:
            module: Full name of the program.
            longest: Seconds that a request may take on a machine that is busy with other things.
        """
        self.longest = longest
        self._module = module
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = ""  # for its temporary files, which it may leave behind
        self._lock = threading.Lock()
        atexit.register(self.close)
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._forget)

    def ask(self, request: dict[str, Any]) -> Told:
        """Answers a request.

        Raises:
            RefusedError: If it cannot be answered.
            LostError: If the process has ended, or took too long.
        """
        with self._lock:
            if self._process is None:
                self._folder = tempfile.mkdtemp(prefix="ico3d-")
                self._process = subprocess.Popen(
                    # -P: nothing is imported from the folder in which somebody starts the server
                    (sys.executable, "-P", "-m", self._module, self._folder),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    # a buffer has a lock, which no forked process could take while a thread asks
                    bufsize=0,
                )
            late = threading.Timer(self.longest, self._process.kill)
            late.daemon = True
            late.start()
            try:
                about, data = _exchange(self._process, request)
            except (OSError, EOFError):
                self.close()
                raise LostError from None
            except BaseException:  # whoever stops in the middle leaves half an answer behind
                self.close()
                raise
            finally:
                late.cancel()
        if "lost" in about:
            raise LostError
        if "error" in about:
            raise RefusedError(str(about["error"]))
        return about, data

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            _close(process)
            shutil.rmtree(self._folder, ignore_errors=True)

    def _forget(self) -> None:
        """Leaves the process to whoever started it: it is that of a parent of this process."""
        process, self._process = self._process, None
        self._lock = threading.Lock()  # a thread that is not here may have held it
        if process is not None:
            _close(process)
            process.returncode = 0  # not to be waited for


def serve(answer: Callable[[dict[str, Any]], Told]) -> None:
    """The main loop of a program: reads requests and writes answers until nobody asks any more.

    Args:
        answer: Answers a request; `LostError` says that a process of its own has ended at it, and
            what else it raises refuses it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    tempfile.tempdir = sys.argv[1]
    asked, told = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # a library that prints something does not spoil an answer
    while header := asked.read(_LENGTH.size):
        (length,) = _LENGTH.unpack(header)
        try:
            about, data = answer(json.loads(asked.read(length)))
        except LostError:
            about, data = {"lost": True}, b""
        except Exception as error:
            about, data = {"error": str(error)}, b""
        words = json.dumps(about).encode()
        told.write(_ANSWER.pack(len(words), len(data)) + words + data)
        told.flush()


def _exchange(process: "subprocess.Popen[bytes]", request: dict[str, Any]) -> Told:
    to, back = process.stdin, process.stdout
    assert to is not None and back is not None
    data = json.dumps(request).encode()
    left = memoryview(_LENGTH.pack(len(data)) + data)
    while left:
        left = left[to.write(left) :]
    words, length = _ANSWER.unpack(_read(back, _ANSWER.size))
    about = json.loads(_read(back, words))
    return about, _read(back, length)


def _close(process: "subprocess.Popen[bytes]") -> None:
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        with contextlib.suppress(OSError):  # what was not sent any more
            pipe.close()


def _read(pipe: Any, count: int) -> bytes:
    data = bytearray()
    while len(data) < count:
        more = pipe.read(min(count - len(data), _PIECE))
        if not more:
            raise EOFError
        data += more
    return bytes(data)
