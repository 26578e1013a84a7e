"""Modules that libraries would take if they were there, and that they are kept from."""

import sys
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def hidden(name: str) -> Generator[None]:
    """While it lasts, whoever imports a module of this name is told that there is none."""
    before = sys.modules.get(name)
    sys.modules[name] = None  # type: ignore (what Python documents for this)
    try:
        yield
    finally:
        del sys.modules[name]
        if before is not None:
            sys.modules[name] = before
