"""Shows how far a long step is, to whoever looks at the terminal and to whoever asked."""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import track

T = TypeVar("T")
Reached = Callable[[str, float], None]
"""Is told the name of a step and which share of it is done, 0 to 1."""


def tracked(
    items: Iterable[T],
    label: str,
    total: int | None,
    console: Console,
    reached: Reached | None = None,
) -> Iterator[T]:
    """Yields items behind a progress bar.

    Args:
        items: What the step goes through.
        label: Name of the step.
        total: Number of items, None where it is unknown; then nobody but the terminal is told.
        console: Where the bar is shown.
        reached: Told after each item.
    """
    for number, item in enumerate(track(items, label, total, console=console), 1):
        yield item
        if reached is not None and total:
            reached(label, min(number / total, 1.0))
