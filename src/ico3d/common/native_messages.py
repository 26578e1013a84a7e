"""What libraries written in C++ print to the standard error, past Python."""

import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager

STANDARD_ERROR = 2


@contextmanager
def held_back() -> Generator[None]:
    """Keeps such messages from the user; they are printed only if what runs within fails.

    Everything that the process writes to the standard error meanwhile is held back, that of other
    threads as well: for short steps, such as opening a model.
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
