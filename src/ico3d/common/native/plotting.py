"""matplotlib reads no settings of the current folder, whoever imports it.

The folder may be a stranger's, and a few bytes of settings take gigabytes, or are a pipe that is
waited for. MediaPipe imports matplotlib as well, so that the guard stands where modules are found.
"""

import os
import sys
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

GUARDED, SETTINGS = "matplotlib", "matplotlibrc"


class Guard:
    """A finder of modules that lets matplotlib look for its settings elsewhere."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where matplotlib is; None for all other modules."""
        spec = PathFinder.find_spec(name, path, target) if name == GUARDED else None
        if spec is not None and spec.loader is not None:
            spec.loader.exec_module = _blind(spec.loader.exec_module)  # type: ignore (a method)
        return spec


def _blind(executed: Callable[[ModuleType], None]) -> Callable[[ModuleType], None]:
    """The same import, during which no settings are in the current folder."""

    def run(module: ModuleType) -> None:
        exists = os.path.exists

        def elsewhere(path: Any) -> bool:
            return path != SETTINGS and exists(path)

        os.path.exists = elsewhere
        try:
            executed(module)
        finally:
            os.path.exists = exists

    return run


def guard() -> None:
    """From now on matplotlib is imported without settings of the current folder."""
    if not any(isinstance(finder, Guard) for finder in sys.meta_path):
        sys.meta_path.insert(0, Guard())
