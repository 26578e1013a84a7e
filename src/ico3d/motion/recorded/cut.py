"""Cuts: the frames of a recording in which gestures were made, with the gestures' names.

They are stored in a text file (TOML) that can be edited by hand.
"""

import json
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

from ico3d.common.typed import Rules, fill, parse_toml
from ico3d.errors import SettingsError

CUTS = "clips.toml"
"""Name of the file in the model folder of a body."""
REST = "rest"
"""Name of a cut in which the person stands with calm hands."""
MOST = 200
"""Most cuts of a recording."""
VERSION = 1
"""Version of the file."""
Hands = Literal["right", "left", "both", "none"]
_NAME = re.compile(r"[a-z]+(_[a-z]+)*")
_LONGEST_NAME = 40
_HEAD = """\
# Gestures that somebody made in a recording. Rename, correct, delete or add them: ico3d bake takes
# this file as it is, ico3d animate shows it. Frames count from 0.
# first: it begins. stroke: it arrives. release: its hold ends. last: it is over.
# hands: "right", "left", "both", or "none" for gestures of the head. "rest": hands hang.

version = {version}
fps = {fps!r}
num_frames = {num_frames}
"""


@dataclass(frozen=True)
class Cut:
    """The frames of one recorded gesture.

    Attributes:
        name: Meaning of the gesture; several cuts may have the same name.
        hands: The hands that make the gesture; `none` for gestures of the head.
        first: Frame at which the gesture begins.
        stroke: Frame at which its stroke arrives.
        release: Frame until which the end of the stroke is held or repeated.
        last: Frame at which the gesture is over.
    """

    name: str
    hands: Hands
    first: int
    stroke: int
    release: int
    last: int

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of the hands that make the gesture; none for gestures of the head."""
        return {"both": ("left", "right"), "none": ()}.get(self.hands, (self.hands,))

    def overlaps(self, other: "Cut") -> bool:
        """Whether this cut and another one share a frame."""
        return self.first <= other.last and self.last >= other.first


@dataclass(frozen=True)
class Cuts:
    """Content of the file of a recording's cuts.

    Attributes:
        version: Version of the file.
        fps: Frames per second of the recording.
        num_frames: Number of frames of the recording.
        clip: The cuts, in any order.
    """

    version: int
    fps: float
    num_frames: int
    clip: tuple[Cut, ...]


def named(cuts: Iterable[Cut]) -> list[tuple[str, Cut]]:
    """Cuts with unique names: the second cut of a name gets `_2` appended, and so on."""
    counted: Counter[str] = Counter()
    found: list[tuple[str, Cut]] = []
    for cut in cuts:
        counted[cut.name] += 1
        number = counted[cut.name]
        found.append((cut.name if number == 1 else f"{cut.name}_{number}", cut))
    return found


def to_toml(cuts: Iterable[Cut], fps: float, num_frames: int) -> str:
    """Text of the file of a recording's cuts.

    Args:
        cuts: The cuts.
        fps: Frames per second of the recording.
        num_frames: Number of frames of the recording.
    """
    blocks = [_HEAD.format(version=VERSION, fps=float(fps), num_frames=num_frames)]
    for cut in cuts:
        lines = [f"{key} = {json.dumps(value)}" for key, value in vars(cut).items()]
        blocks.append("\n".join(["[[clip]]", *lines, ""]))
    return "\n".join(blocks)


def from_toml(content: bytes, where: str, fps: float, num_frames: int) -> tuple[Cut, ...]:
    """The cuts in a file.

    Args:
        content: Content of the file.
        where: Name of the file, for error messages.
        fps: Frames per second of the recording.
        num_frames: Number of frames of the recording.

    Raises:
        SettingsError: If the file is damaged, makes no sense or belongs to another recording.
    """
    try:
        values: dict[str, Any] = parse_toml(content.decode())
    except ValueError as error:
        raise SettingsError(f"{where} is not valid TOML ({error}).") from error
    cuts = fill(Cuts, {"clip": [], **values}, where, Rules(SettingsError))
    _require(cuts.version == VERSION, f"{where}: version must be {VERSION}")
    if (cuts.fps, cuts.num_frames) != (fps, num_frames):
        raise SettingsError(
            f"{where} is of a recording of {cuts.num_frames} frames at {cuts.fps:g} per second, "
            f"but this one has {num_frames} at {fps:g}: delete it to find gestures anew."
        )
    _require(len(cuts.clip) <= MOST, f"{where} must have {MOST} clips at most")
    for number, cut in enumerate(cuts.clip):
        _check(cut, f"{where}: clip[{number}]", num_frames)
    return cuts.clip


def _check(cut: Cut, where: str, num_frames: int) -> None:
    sound = _NAME.fullmatch(cut.name) and len(cut.name) <= _LONGEST_NAME
    _require(bool(sound), f"{where}.name must be small letters and '_', not {cut.name[:40]!r}")
    order = (0, cut.first, cut.stroke, cut.release, cut.last, num_frames - 1)
    ascends = all(a <= b for a, b in pairwise(order))
    inside = f"must ascend within 0 to {num_frames - 1}"
    _require(ascends and cut.first < cut.last, f"{where}: first, stroke, release and last {inside}")


def _require(holds: bool, sentence: str) -> None:
    if not holds:
        raise SettingsError(f"{sentence}.")
