"""How far an avatar is, in a file that the page is shown and that outlives every process."""

import io
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

from PIL import Image

from ico3d.common.files import read_small, write_atomic
from ico3d.common.typed import plain
from ico3d.creating.events import (
    STEPS,
    Advanced,
    Event,
    Looked,
    Made,
    Planned,
    Preview,
    Step,
    Voiced,
)
from ico3d.creating.looking.advice import Advice, Level
from ico3d.creating.settings import QualityName
from ico3d.recording.keeping.noted import noted
from ico3d.recording.making.estimate import Estimate

FILE, FACE = "progress.json", "face.jpg"
State = Literal["running", "stopped", "failed", "made"]
MOST_PICTURE, MOST_SIDE = 1 << 20, 4096
"""Bytes of the picture of the face, and pixels of a side."""
DEEPEST, MOST_FACES = 8, 10**6
"""How deep lists and objects lie in one another at most, and how many pictures a making shows."""
OFTEN = 1.0
"""Seconds between two writings, where nothing but a share has changed."""


@dataclass(frozen=True)
class Progress:
    """How far an avatar is.

    Attributes:
        state: Whether it is being made, was stopped, cannot be made, or is there.
        quality: How well it is made.
        step: What is being done; `join` before the steps of `ico3d create`.
        share: How much of that is done, 0 to 1.
        left: Expected seconds of all that is left but baking; None where nobody knows yet.
        later: Those of them that belong to the steps after this one.
        told: When that was so, in seconds since 1970.
        advice: What would make it better, each as `plain` writes an `Advice`.
        refused: Why nothing can be made of the video, likewise; empty where something can.
        faces: Number of pictures of the face that have been shown.
        error: Why it failed, in English; empty where it did not.
        code: Name of why it failed in `FAILURES`; empty where nobody foresaw it.
        values: What stands in that text.
        decibels: How good it is on pictures that it never saw; None where that is not known.
        made_of: What tells the recording and the body of which it is made from others.
    """

    state: State
    quality: QualityName
    step: Step | Literal["join"] = "join"
    share: float = 0.0
    left: float | None = None
    later: float = 0.0
    told: float = 0.0
    advice: tuple[dict[str, Any], ...] = ()
    refused: tuple[dict[str, Any], ...] = ()
    faces: int = 0
    error: str = ""
    code: str = ""
    values: dict[str, float | str] = field(default_factory=dict)
    decibels: float | None = None
    made_of: dict[str, Any] = field(default_factory=dict)

    def left_at(self, now: float) -> float | None:
        """Expected seconds that are left at a time, however long nothing was reported.

        Time passes of the step that goes on alone: what later steps need stays.

        Args:
            now: The time in seconds since 1970.
        """
        if self.left is None:
            return None
        passed = max(now - self.told, 0.0)  # a clock may be set back
        return max(self.left - passed, min(self.later, self.left))

    def is_of(self, id: str) -> bool:
        """Whether the avatar is made of a part; also where it is not known of which."""
        parts = self.made_of.get("parts")
        if not isinstance(parts, list):
            return True
        names = [str(one[0]) for one in parts if isinstance(one, list) and one]
        return any(name.partition(".")[0] == id for name in names)


def read_progress(folder: Path) -> Progress | None:
    """The progress in a folder; None where nothing was begun."""
    try:
        found = Progress(**noted(folder / FILE))
        if not _is_sound(found):
            return None
        left = None if found.left is None else float(found.left)
        numbers = {"left": left, "later": float(found.later), "told": float(found.told)}
        seen = (*numbers.values(), found.decibels)
        lists = {"advice": tuple(found.advice), "refused": tuple(found.refused)}
        if not all(math.isfinite(number or 0.0) for number in seen):
            return None
        return replace(found, made_of=dict(found.made_of), **numbers, **lists)
    except (OSError, ValueError, TypeError, KeyError, OverflowError):
        return None


def shown_face(folder: Path) -> bytes | None:
    """The picture of the face, a JPEG; None where there is none, or none of ours.

    What lies there may be a stranger's, and a page decodes it whatever its size is.
    """
    try:
        content = read_small(folder / FACE, links=False, most=MOST_PICTURE)
        with Image.open(io.BytesIO(content), formats=("JPEG",)) as picture:
            return content if max(picture.size) <= MOST_SIDE else None
    except (OSError, ValueError, Image.DecompressionBombError):
        return None


def _is_sound(found: Progress) -> bool:
    """Whether all is of its kind in what was read, but for numbers: it may be a stranger's."""
    known = found.state in get_args(State) and found.quality in get_args(QualityName)
    known = known and found.step in ("join", *STEPS)
    texts = all(isinstance(text, str) for text in (found.error, found.code))
    share = isinstance(found.share, (int, float)) and 0 <= found.share <= 1
    counted = isinstance(found.faces, int) and 0 <= found.faces <= MOST_FACES
    good = found.decibels is None or isinstance(found.decibels, (int, float))
    parts = (found.advice, found.refused, found.values, found.made_of)
    return known and texts and share and counted and good and all(map(_is_shallow, parts))


def _is_shallow(value: object, levels: int = DEEPEST) -> bool:
    """Whether lists and objects lie in one another no deeper than in what is written here."""
    if not isinstance(value, (list, tuple, dict)):
        return True
    inside = value.values() if isinstance(value, dict) else value
    return levels > 0 and all(_is_shallow(one, levels - 1) for one in inside)


def begun(folder: Path, quality: QualityName, made_of: dict[str, Any] | None = None) -> Progress:
    """The progress of a making that begins, or goes on: with the pictures that there are.

    Args:
        folder: Where it is kept.
        quality: How well the avatar is made.
        made_of: Of which recording and body; None for those that are noted there.
    """
    before = read_progress(folder) or Progress("running", quality)
    of = before.made_of if made_of is None else made_of
    return Progress("running", quality, faces=before.faces, made_of=of)


def write_progress(folder: Path, progress: Progress) -> None:
    """Writes the progress into a folder.

    Raises:
        StorageError: If the disk is full.
    """
    write_atomic(folder / FILE, json.dumps(plain(progress), indent=1).encode())


@dataclass
class Reporter:
    """Is told by `create` what happens, and keeps the progress in a folder.

    Attributes:
        folder: Where it is kept, with the latest picture of the face.
        progress: What is known.
        now: Returns the time in seconds.
        date: Returns the seconds since 1970, which the server's process knows, too.
    """

    folder: Path
    progress: Progress
    now: Callable[[], float] = time.monotonic
    date: Callable[[], float] = time.time
    _estimate: Estimate | None = None
    _written: float = float("-inf")

    def __call__(self, event: Event) -> None:
        """Takes an event of `create`."""
        if isinstance(event, Looked):
            found = event.found.advice
            self.change(advice=_of(found, "better"), refused=_of(found, "refused"))
        elif isinstance(event, Voiced) and event.why:
            self.change(advice=(*self.progress.advice, plain(event.why)))
        elif isinstance(event, Planned):
            self._estimate = Estimate(event.seconds)
            self.change(**self._left("track", 0.0))  # which begins now
        elif isinstance(event, Advanced):
            self._advance(event.step, event.share)
        elif isinstance(event, Preview):
            image = Image.fromarray(event.picture)
            write_atomic(self.folder / FACE, lambda file: image.save(file, quality=88))
            self.change(faces=self.progress.faces + 1)
        elif isinstance(event, Made):
            self.change(step="bake", share=1.0, left=0.0, later=0.0, decibels=event.measured.face)

    def change(self, **values) -> None:
        """Writes what has changed."""
        self.progress = replace(self.progress, **values)
        write_progress(self.folder, self.progress)
        self._written = self.now()

    def _advance(self, step: Step, share: float) -> None:
        """Notes how much of a step is done; of a step that goes on only now and then."""
        if step == self.progress.step and share < 1 and self.now() - self._written < OFTEN:
            return
        self.change(step=step, share=round(share, 4), **self._left(step, share))

    def _left(self, step: Step, share: float) -> dict[str, float]:
        """What is known of the time that is left, of which a share of a step is done."""
        if self._estimate is None:
            return {}
        left = self._estimate.left(step, share, self.now())
        later = self._estimate.later(step)
        return {"left": round(left, 1), "later": round(later, 1), "told": self.date()}


def _of(advice: Sequence[Advice], level: Level) -> tuple[dict[str, Any], ...]:
    """The advice of one level, as it is kept."""
    return tuple(plain(one) for one in advice if one.level == level)
