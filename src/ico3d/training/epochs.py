"""The order in which training takes up its pictures."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np


class Epochs:
    """Each of a number of things once per epoch, in an order of its own.

    The order depends on the key and the epoch alone: a resumed run goes on as it would have, and
    the pictures of later steps are known in advance.
    """

    def __init__(self, key: Sequence[int], count: int):
        """Orders `count` things.

        Args:
            key: Seeds of the orders.
            count: Number of things, at least 1.
        """
        self._key, self._count = tuple(key), count
        self._order = lru_cache(maxsize=2)(self._shuffled)  # reading ahead asks for the next one

    def at(self, step: int) -> int:
        """The number of the thing that a step takes up."""
        epoch, place = divmod(step, self._count)
        return int(self._order(epoch)[place])

    def _shuffled(self, epoch: int) -> np.ndarray:
        """(count,) the order of one epoch."""
        return np.random.default_rng([*self._key, epoch]).permutation(self._count)
