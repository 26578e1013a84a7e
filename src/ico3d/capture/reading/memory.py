"""How much memory pictures may take."""

from threading import Lock
from typing import Literal

from ico3d.common.unpacking.memory import free_memory

Gib = float | Literal["auto"]
"""A limit of memory in GiB; `auto` for a share of what is free."""

SHARE = 0.5
"""Part of the free memory that the pictures of one process take."""


class Budget:
    """Memory for pictures.

    With `auto`, it follows what is free: of several processes that fill their memory at the same
    time, each leaves a part to the others, and together they never take all of it.

    Attributes:
        used: Bytes that are taken.
    """

    def __init__(self, gib: Gib):
        """Sets the limit."""
        self._gib, self.used, self._turn = gib, 0, Lock()

    def left(self) -> int:
        """Bytes that may still be taken."""
        if self._gib == "auto":
            return int(SHARE * (free_memory() + self.used)) - self.used
        return int(self._gib * 2**30) - self.used

    def take(self, size: int) -> bool:
        """Takes `size` bytes if so many are left; whether it did."""
        with self._turn:
            fits = size <= self.left()
            self.used += size if fits else 0
        return fits
