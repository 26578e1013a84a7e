"""Hides messages that C++ libraries print to the standard error stream, bypassing Python."""

import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager

STANDARD_ERROR = 2


@contextmanager
def held_back() -> Generator[None]:
    """Hides what libraries print to the standard error stream, unless the `with` block raises.

    If the block raises, everything held back is printed. The stream of the whole process is
    redirected, other threads included, so use it only around short steps such as opening a model.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    shown = os.dup(STANDARD_ERROR)
    try:
        with tempfile.TemporaryFile() as held:
            os.dup2(held.fileno(), STANDARD_ERROR)
            try:
                yield
            except BaseException:
                held.seek(0)
                os.write(shown, held.read())
                raise
            finally:
                os.dup2(shown, STANDARD_ERROR)
    finally:
        os.close(shown)
