"""Compares a text with many at once, by the terms that they share."""

import math
from collections.abc import Mapping, Sequence

import numpy as np


class Index:
    """Which texts have a term, and how much it weighs in them.

    It is made once, so that a question costs no more than the entries of its own terms.
    """

    def __init__(self, texts: Sequence[Mapping[str, float]]):
        """Takes the texts, each as the weights of its terms."""
        self._count = len(texts)
        self._rows: dict[str, int] = {}
        entries = [
            (self._rows.setdefault(term, len(self._rows)), at, weight)
            for at, text in enumerate(texts)
            for term, weight in _unit(text).items()
        ]
        rows, places, weights = zip(*entries, strict=True) if entries else ((), (), ())
        order = np.argsort(np.array(rows, np.int64), kind="stable")
        self._places = np.array(places, np.int64)[order]
        self._weights = np.array(weights, np.float64)[order]
        counts = np.bincount(np.array(rows, np.int64), minlength=len(self._rows))
        self._ends = np.cumsum(counts)

    def cosines(self, said: Mapping[str, float]) -> np.ndarray:
        """(T,) cosine of the angle between each of the texts and another."""
        products = np.zeros(self._count)
        for term, weight in _unit(said).items():
            row = self._rows.get(term)
            if row is None:
                continue
            part = slice(self._ends[row - 1] if row else 0, self._ends[row])
            products[self._places[part]] += weight * self._weights[part]  # each text once
        return products


def _unit(vector: Mapping[str, float]) -> dict[str, float]:
    """A sparse vector of length 1; nothing where it has no length."""
    length = math.hypot(*vector.values())
    return {term: value / length for term, value in vector.items()} if length else {}
