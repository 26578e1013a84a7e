"""How long the parts of a turn took."""

from collections.abc import Callable

PARTS = ("vad", "turn", "language", "voice", "expression", "send")


class TurnTimer:
    """Takes the time from the end of the visitor's words to the first sound of the answer.

    The parts in order: `vad` until silence is noticed, `turn` until the turn is taken to be over
    (the recogniser finishes meanwhile: `recognition`), `language` until the first sentence,
    `voice` until its first sound, `expression` until its face, `send` until it is on its way.
    """

    def __init__(self, now: Callable[[], float]):
        """Reads the clock `now`, in seconds."""
        self._now = now
        self._marks: dict[str, float] = {}
        self._start: float | None = None

    def start(self, ago: float = 0.0) -> None:
        """The visitor's last word ended (`ago` seconds ago)."""
        self._start = self._now() - ago
        self._marks = {}

    def mark(self, part: str) -> None:
        """A part is done; only its first time in a turn counts."""
        if self._start is not None:
            self._marks.setdefault(part, self._now())

    def is_running(self) -> bool:
        """Whether a turn waits for its first sound."""
        return self._start is not None

    def finish(self) -> dict[str, float]:
        """Milliseconds by part and in total; the next turn needs a new start."""
        if self._start is None:
            return {}
        before, values = self._start, {}
        for part in PARTS:
            at = max(before, self._marks.get(part, before))
            values[part] = 1000 * (at - before)
            before = at
        values["total"] = 1000 * (before - self._start)
        if "recognition" in self._marks and "vad" in self._marks:
            values["recognition"] = 1000 * (self._marks["recognition"] - self._marks["vad"])
        self._start = None
        return values
