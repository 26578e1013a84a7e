"""Types for pyright: none, for the import of every model would take half of its time."""

from typing import Any

def __getattr__(name: str) -> Any: ...
