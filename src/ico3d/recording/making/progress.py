"""How far an avatar is, in a file that the page is shown and that outlives every process."""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from PIL import Image

from ico3d.common.files import write_atomic
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
from ico3d.creating.settings import QualityName

FILE, FACE = "progress.json", "face.jpg"
State = Literal["running", "stopped", "failed", "made"]
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
        advice: What would make it better.
        faces: Number of pictures of the face that have been shown.
        error: Why it failed; empty where it did not.
        decibels: How good it is on pictures that it never saw; None where that is not known.
    """

    state: State
    quality: QualityName
    step: Step | Literal["join"] = "join"
    share: float = 0.0
    left: float | None = None
    advice: tuple[str, ...] = ()
    faces: int = 0
    error: str = ""
    decibels: float | None = None


def read_progress(folder: Path) -> Progress | None:
    """The progress in a folder; None where nothing was begun."""
    try:
        values = json.loads((folder / FILE).read_text("utf-8"))
        return Progress(**(values | {"advice": tuple(values["advice"])}))
    except (OSError, ValueError, TypeError, KeyError):
        return None


def begun(folder: Path, quality: QualityName) -> Progress:
    """The progress of a making that begins, or goes on: with the pictures that there are."""
    before = read_progress(folder)
    return Progress("running", quality, faces=0 if before is None else before.faces)


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
    """

    folder: Path
    progress: Progress
    now: Callable[[], float] = time.monotonic
    _plan: dict[Step, float] = field(default_factory=dict)
    _written: float = float("-inf")

    def __call__(self, event: Event) -> None:
        """Takes an event of `create`."""
        if isinstance(event, Looked):
            better = tuple(str(one) for one in event.found.advice if one.level == "better")
            self.change(advice=better)
        elif isinstance(event, Voiced) and event.why:
            without = f"The avatar is made without a voice of its own: {event.why}"
            self.change(advice=(*self.progress.advice, without))
        elif isinstance(event, Planned):
            self._plan = dict(event.seconds)
            self.change(left=sum(self._plan.values()))
        elif isinstance(event, Advanced):
            self._advance(event.step, event.share)
        elif isinstance(event, Preview):
            image = Image.fromarray(event.picture)
            write_atomic(self.folder / FACE, lambda file: image.save(file, quality=88))
            self.change(faces=self.progress.faces + 1)
        elif isinstance(event, Made):
            self.change(step="bake", share=1.0, left=0.0, decibels=event.measured.face)

    def change(self, **values) -> None:
        """Writes what has changed."""
        self.progress = replace(self.progress, **values)
        write_progress(self.folder, self.progress)
        self._written = self.now()

    def _advance(self, step: Step, share: float) -> None:
        """Notes how much of a step is done; of a step that goes on only now and then."""
        if step == self.progress.step and share < 1 and self.now() - self._written < OFTEN:
            return
        left = None
        if self._plan:
            later = STEPS[STEPS.index(step) + 1 :]
            now = self._plan.get(step, 0.0) * (1 - share)
            left = round(now + sum(self._plan.get(one, 0.0) for one in later), 1)
        self.change(step=step, share=round(share, 4), left=left)
