"""How much of what an avatar learns from has been recorded."""

from collections.abc import Iterable
from dataclasses import dataclass

from ico3d.recording.guiding.guide import extremes
from ico3d.recording.keeping.person import Part
from ico3d.recording.keeping.plan import CONSENT, TURNS, UPLOAD, Turn, scripts

ENOUGH = 60.0
"""Seconds of talking from which on a recording is long enough."""


@dataclass(frozen=True)
class Coverage:
    """What is covered by the parts that were kept.

    Attributes:
        seconds: Length of all parts but the spoken consent.
        enough: Seconds from which on it is long enough.
        turns: How far the head was turned each way, 0 to 1.
        sounds: Number of the language's speech sounds in the texts that were read.
        of_sounds: Number of all of them.
    """

    seconds: float
    enough: float
    turns: dict[Turn, float]
    sounds: int
    of_sounds: int


def covered(parts: Iterable[Part], language: str) -> Coverage:
    """What is covered by parts whose texts are in a language.

    A turn counts as far as the tracker saw it; without a tracker, as done once it was recorded.
    """
    script = scripts()[language]
    kept = {part.id: part.report for part in parts if part.report is not None}
    turns: dict[Turn, float] = dict.fromkeys(TURNS, 0.0)
    for id, report in kept.items():
        seen = report["turn"]
        far = {turn: float(id == turn) for turn in TURNS} if seen is None else extremes(seen)
        turns = {turn: max(turns[turn], far[turn]) for turn in TURNS}
    heard: set[str] = set()
    for number, sounds in enumerate(script.heard, 1):
        if f"text-{number}" in kept:
            heard.update(sounds)
    seconds = sum(report["seconds"] for id, report in kept.items() if id not in (CONSENT, UPLOAD))
    return Coverage(round(seconds, 1), ENOUGH, turns, len(heard), len(script.sounds))
