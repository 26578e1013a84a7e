"""What the bench of the paper's own size measures, part by part; failures are rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from full_size import parity, speed
from full_size.frames import random_person
from full_size.interrupting import paper_options, train_twice
from full_size.recordings import draw_body, draw_head
from ico3d.common.device import DeviceName
from ico3d.protocols.report import Column, Value
from ico3d.protocols.viewer import SIZES, viewer_columns, viewer_rows
from ico3d.splat.device import CPU
from ico3d.training.dry_run import TIMED

Row = dict[str, Value]
TRAINING = (
    Column("num_gaussians", "Gaussians", 0),
    Column("train_seconds", "steps, s", 1),
    Column("cpu_seconds", "processor, s", 1),
    Column("peak_mib", "memory of the GPU, MiB", 0),
    Column("tensors", "tensors", 0),
    Column("alike", "the same, bit for bit", 0),
    Column("greatest", "greatest difference", 8),
)


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Attributes:
        parity: Number of Gaussians, and side of the pictures in pixels.
        scenes: Number of Gaussians, width and height of pictures that are drawn.
        runs: Pictures that are timed.
        counts: Numbers of Gaussians of training steps.
        picture: Side of the recordings of these steps, pixels.
        parts: Numbers of Gaussians of background, body and head.
        frames: Widths and heights of pictures of the viewer.
        pictures: Number of these that are timed.
        steps: Steps of the trainings that are killed.
        trained: Side of their recordings, pixels.
    """

    parity: tuple[int, int]
    scenes: tuple[tuple[int, int, int], ...]
    runs: int
    counts: tuple[int, ...]
    picture: int
    parts: tuple[int, int, int]
    frames: tuple[tuple[int, int], ...]
    pictures: int
    steps: int
    trained: int


FULL = Sizes(
    (5_000, 256),
    ((20_000, 256, 256), (100_000, 512, 512), (150_000, 1920, 1080)),
    30,
    (12_000, 50_000, 100_000),
    512,
    (100_000, 100_000, 50_000),
    SIZES,
    30,
    300,
    64,
)
TINY = Sizes((200, 24), ((200, 24, 24),), 2, (300,), 24, (90, 80, 70), ((24, 16),), 2, 12, 20)


def row_of(name: str, work: Callable[[], Mapping[str, Value]]) -> Row:
    """A row of what some work measures, or of the error that ended the work."""
    try:
        return {"name": name, **work()}
    except Exception as error:  # of many kinds: drivers, compilers, memory
        return failed(name, error)


def failed(name: str, error: Exception) -> Row:
    """The row of what an error ended."""
    said = str(error).strip().split("\n")[0].replace("|", "/")
    return {"name": name, "fault": f"{type(error).__name__}: {said}"}


@dataclass(frozen=True)
class Measured:
    """A part of the report.

    Attributes:
        title: Heading.
        text: Sentences that say what was measured, and how.
        columns: Columns of the table.
        rows: Values by key; those that failed have a `fault`.
    """

    title: str
    text: str
    columns: Sequence[Column]
    rows: list[Row]


@dataclass(frozen=True)
class Parts:
    """The parts, each of which can be measured alone.

    Attributes:
        out: Folder for recordings and trainings.
        sizes: How much is measured.
        device: Where to compute.
        models: Folder of weights for trainings; None for those that are installed.
    """

    out: Path
    sizes: Sizes
    device: torch.device
    models: str | None

    @property
    def _name(self) -> DeviceName:
        return "cuda" if self.device.type == "cuda" else "cpu"

    def parity(self) -> Measured:
        """Pictures and gradients of the GPU against those of the CPU."""
        count, size = self.sizes.parity
        text = (
            f"Differences relative to the largest value, by quantiles over all numbers: {count:,} "
            f"Gaussians, two cameras, {size} × {size} pixels, all gradients. The bound is for all "
            "but a few numbers, because a pixel at a splat's rim is drawn with alpha 1/255, or "
            "not at all, by the last bit of its distance."
        )
        title = "Does the GPU draw what the CPU draws?"
        if self.device == CPU:
            return Measured(title, "There is no GPU to compare with.", parity.COLUMNS, [])
        try:
            rows = parity.parity_rows(self.device, count, size)
        except Exception as error:  # of many kinds: drivers, compilers, memory
            rows = [failed("CPU against CUDA", error)]
        return Measured(title, text, parity.COLUMNS, rows)

    def drawing(self) -> Measured:
        """Pictures of random Gaussians, and their gradients."""
        rows = [
            row_of(
                f"{count:,} Gaussians at {width} × {height}",
                lambda: speed.drawing_row(self.device, count, width, height, self.sizes.runs),  # noqa: B023
            )
            for count, width, height in self.sizes.scenes
        ]
        text = f"Medians of {self.sizes.runs}, awaited before and after."
        return Measured("How long does a picture take?", text, speed.DRAWING, rows)

    def steps(self) -> Measured:
        """Training steps of heads and bodies, and what they come to."""
        rows = []
        for count in self.sizes.counts:
            rows += [
                row_of(
                    f"head, {count:,} Gaussians",
                    lambda: speed.head_row(self._steps_of("head"), count, self._name),  # noqa: B023
                ),
                row_of(
                    f"body, {count:,} Gaussians",
                    lambda: speed.body_row(
                        self._steps_of("body"),
                        self.out / f"plan-{count}",  # noqa: B023
                        count,  # noqa: B023
                        self._name,
                    ),
                ),
            ]
        size = self.sizes.picture
        text = (
            f"--preset paper on drawn recordings of {size} × {size} pixels: medians of {TIMED} of "
            "the last steps, with all terms of the loss, after as many that were not timed; "
            "awaited before and after. All steps of the preset, of a body those of one window, are "
            "extrapolated from there, as if there were that many Gaussians from the first step on."
        )
        return Measured("How long does training take?", text, speed.STEPS, rows)

    def frames(self) -> Measured:
        """The paper's table of frame rates."""
        behind, of_body, of_head = self.sizes.parts
        columns = viewer_columns(self.sizes.frames)
        try:
            person = random_person(behind, of_body, of_head, self.device)
            rows = viewer_rows(person, self.sizes.frames, self.sizes.pictures)
        except Exception as error:  # of many kinds: drivers, compilers, memory
            rows = [failed("person", error)]
        text = (
            f"Random Gaussians through the paper's networks: {behind:,} of the background, "
            f"{of_body:,} of the body, {of_head:,} of the head (the paper names no numbers). "
            f"Medians of {self.sizes.pictures} pictures, each of another moment and by another "
            "camera, from the moment's Gaussians to the picture, awaited before and after. "
            "The paper's viewer draws all with 70.6 FPS on an RTX 2080 and 105.3 FPS on a 4090 "
            "Laptop."
        )
        return Measured("How fast is the viewer?", text, columns, rows)

    def training(self, verbs: Sequence[str] = ("head", "body", "static")) -> Measured:
        """The paper's settings end to end, killed and gone on with."""
        steps, size = self.sizes.steps, self.sizes.trained
        rows = []
        for verb in verbs:

            def trained(verb: str = verb) -> Mapping[str, Value]:
                recording = self._recording("head" if verb == "head" else "body", size)
                options = paper_options(verb, steps, self._name)
                found = train_twice(verb, recording, self.out, options, self.models)
                return asdict(found) | {"peak_mib": found.peak_mib or None}

            rows.append(row_of({"static": "scene"}.get(verb, verb), trained))
        text = (
            f"`ico3d train … --preset paper`, {steps} steps at {size} × {size} pixels: the head "
            "with SGD, VGG from the first step and harmonics of degree 3, driven by speech; the "
            "body in two windows with harmonics and maps of the cameras' colours, then fine-tuned; "
            "a scene. Trained at a stretch, and killed by SIGKILL at the first checkpoint and gone "
            "on with. On a GPU sums come in any order: differences are stated, relative to the "
            "largest value of each tensor; none is stated where numbers of Gaussians differ."
        )
        return Measured("Do the paper's settings train, and go on?", text, TRAINING, rows)

    def _steps_of(self, what: str) -> Path:
        return self._recording(what, self.sizes.picture)

    def _recording(self, what: str, size: int) -> Path:
        """A recording of a head or a body, drawn at the first need."""
        folder = self.out / f"{what}-{size}"
        if not folder.exists():
            (draw_head if what == "head" else draw_body)(folder, size, self.device)
        return folder
