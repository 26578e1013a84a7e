"""What is wrong with a video, in words for the person who filmed it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from ico3d.creating.looking.texts import TEXTS

Level = Literal["refused", "better"]
"""Whether nothing can be made of the video, or something better could."""
Values = Mapping[str, float | str]
"""What stands in a text, by its name there."""
MOST_SPANS = 40
"""Spans of one advice: a film may have thousands, nobody reads more than some, and each page that
shows them asks for all again and again."""


@dataclass(frozen=True)
class Advice:
    """One thing that would make a video better.

    Attributes:
        code: Name of the text in `TEXTS`, by which a page finds it in its own languages.
        level: `refused` if nothing can be made of the video as it is.
        values: What stands in the text.
        spans: Seconds (first, last) where it is so; none where it is so all along.
        detail: What whoever looks after the machine may want to know besides, in English.
    """

    code: str
    level: Level = "better"
    values: Values = field(default_factory=dict)
    spans: tuple[tuple[float, float], ...] = ()
    detail: str = ""

    @property
    def topic(self) -> str:
        """What it is about."""
        return self.code.partition("-")[0]

    @property
    def text(self) -> str:
        """What is wrong and what helps, in plain English."""
        return TEXTS[self.code].format(**self.values)

    def __str__(self) -> str:
        """The text with the seconds before it and the detail behind it."""
        seconds = f"{when(self.spans)}: " if self.spans else ""
        return f"{seconds}{self.text} {self.detail}".rstrip()


def spans_of(seconds: Sequence[float], apart: float) -> tuple[tuple[float, float], ...]:
    """Moments as spans, `MOST_SPANS` at most: moments no farther than `apart` from another are one.

    Args:
        seconds: The moments.
        apart: Seconds.
    """
    spans: list[tuple[float, float]] = []
    for second in sorted(seconds):
        if spans and second - spans[-1][1] <= apart:
            spans[-1] = (spans[-1][0], second)
        else:
            spans.append((second, second))
    return tuple(spans[:MOST_SPANS])


def when(spans: Sequence[tuple[float, float]], most: int = 4) -> str:
    """Spans in words: "at 3 s and 7 to 9 s"; of many the first ones."""
    shown = [_span(*span) for span in spans[:most]]
    if len(spans) > most:
        return f"at {', '.join(shown)} and {len(spans) - most} more times"
    return "at " + " and ".join(filter(None, [", ".join(shown[:-1]), shown[-1]]))


def _span(first: float, last: float) -> str:
    begin, end = round(first), round(last)
    return f"{begin} s" if begin == end else f"{begin} to {end} s"
