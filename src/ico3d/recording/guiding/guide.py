"""What to tell somebody before the camera: one instruction at a time, the most urgent one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ico3d.creating.looking.picture_checks import BLURRED, BRIGHT, BURNT, DARK, SMALL
from ico3d.creating.looking.samples import Sample
from ico3d.recording.keeping.plan import TURNS, Turn

Word = Literal[
    "face", "faces", "light", "bright", "frame", "closer", "further", "still", "good",
    "left", "right", "up", "down", "ahead",
]  # fmt: skip
"""What is told: the page's own words are those of `studio.guide.WORD`."""
LARGE = 0.62
"""Width of a face, as a share of the picture's short side, from which on it is too near."""
GOALS: dict[Turn, float] = {"left": 20.0, "right": 20.0, "up": 9.0, "down": 9.0}
"""Degrees by which the head is to be turned."""
STRAIGHT = 12.0
"""Degrees to a side within which somebody looks ahead."""


@dataclass(frozen=True)
class Told:
    """What is told of one picture.

    Attributes:
        word: The instruction.
        turned: How far the head is turned each way, as a share of the goal, 0 to 1; None where no
            face was looked for or found.
    """

    word: Word
    turned: dict[Turn, float] | None


def instruct(sample: Sample, size: int, wanted: Turn | None) -> Told:
    """The most urgent instruction.

    Args:
        sample: What is seen in the picture.
        size: Short side of the picture in pixels.
        wanted: Way to turn the head; None where the person is to look ahead.
    """
    if not sample.faces:
        return Told("light" if sample.light < DARK else "face", None)
    turned = shares(*sample.turn)
    fault = _fault(sample, size)
    if fault is not None:
        return Told(fault, turned)
    if wanted is not None:
        return Told("good" if turned[wanted] >= 1 else wanted, turned)
    return Told("ahead" if abs(sample.turn[0]) > STRAIGHT else "good", turned)


def without_faces(light: float, sharpness: float | None) -> Told:
    """What brightness and blur tell where no face can be looked for.

    Args:
        light: Mean brightness of the middle of the picture, 0 to 1.
        sharpness: That of its middle; None where it cannot be measured.
    """
    if light < DARK:
        return Told("light", None)
    if light > BRIGHT:
        return Told("bright", None)
    blurred = sharpness is not None and sharpness < BLURRED
    return Told("still" if blurred else "good", None)


def shares(to_left: float, up: float) -> dict[Turn, float]:
    """How far a head is turned each way, as a share of the goal, 0 to 1.

    Args:
        to_left: Degrees by which it looks to its left.
        up: Degrees by which it looks up.
    """
    degrees: dict[Turn, float] = {"left": to_left, "right": -to_left, "up": up, "down": -up}
    return {turn: min(max(degrees[turn] / GOALS[turn], 0.0), 1.0) for turn in TURNS}


def extremes(turn: Sequence[float]) -> dict[Turn, float]:
    """How far a head was turned each way in a part, as a share of the goal, 0 to 1.

    Args:
        turn: Degrees: least to the left, most, least up, most.
    """
    right, left, down, up = turn
    most, least = shares(left, up), shares(right, down)
    return {way: max(most[way], least[way]) for way in TURNS}


def _fault(sample: Sample, size: int) -> Word | None:
    """What is wrong with a picture that shows a face, if anything is."""
    faults: tuple[tuple[Word, bool], ...] = (
        ("faces", sample.faces > 1),
        ("light", sample.light < DARK),
        ("bright", sample.burnt > BURNT or sample.light > BRIGHT),
        ("further", sample.width > LARGE * size),
        ("frame", not sample.inside),
        ("closer", sample.width < SMALL * size),
        ("still", sample.sharpness < BLURRED),
    )
    return next((word for word, is_so in faults if is_so), None)
