"""What becomes of the figures of several seeds."""

from collections.abc import Mapping, Sequence

import numpy as np

from ico3d.protocols.report import Value


def means(rows: Sequence[Mapping[str, Value]]) -> dict[str, Value]:
    """Means over rows of the numbers that all of them have."""
    found: dict[str, Value] = {}
    for key in rows[0]:
        numbers = _numbers(rows, key)
        if len(numbers) == len(rows):
            found[key] = float(np.mean(numbers))
    return found


def spread_of(rows: Sequence[Mapping[str, Value]], key: str) -> float | None:
    """The difference of the greatest and the least value; None of fewer than two."""
    numbers = _numbers(rows, key)
    return max(numbers) - min(numbers) if len(numbers) > 1 else None


def _numbers(rows: Sequence[Mapping[str, Value]], key: str) -> list[float]:
    values = (row.get(key) for row in rows)
    return [value for value in values if isinstance(value, float | int)]
