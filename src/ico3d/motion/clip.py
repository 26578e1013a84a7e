"""Gestures as rotation curves by role, and the files that hold them."""

import base64
import json
import re
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import save

from ico3d.common.typed import parse_json
from ico3d.common.unpacking.heads import bounded_head, load_bounded
from ico3d.errors import SettingsError
from ico3d.motion.curves import LONGEST, TOLERANCE, Curve, packed, reduced, unpacked
from ico3d.motion.roles import INDEX, ROLES, SIDES, mirrored_role
from ico3d.motion.turning import mirrored
from ico3d.rig.quaternions import Array, continuous

VERSION = 1
"""Version of the files."""
MOST_CLIPS, LONGEST_NAME = 1000, 100
"""Gestures of a file, and letters of a name: each question of a visitor is compared with all."""
MOST_BYTES = 4 << 20
"""Bytes of a file, 27 times those of the packaged person's: a page keeps each key as numbers."""
_DAMAGE = (ValueError, KeyError, TypeError, AttributeError, OverflowError)
"""What parts of damaged files raise."""


def meaning(name: str) -> str:
    """Meaning of a clip: its name without the number that tells clips of one meaning apart."""
    return re.sub(r"_\d+$", "", name)


def other_hand(meant: str) -> str:
    """Meaning of the same gesture with the other hand, such as `beat_left` for `beat_right`.

    A meaning that names no hand is returned as it is.
    """
    gesture, _, side = meant.rpartition("_")
    return f"{gesture}_{SIDES[1 - SIDES.index(side)]}" if side in SIDES else meant


@dataclass(frozen=True)
class Marks:
    """Times of the phases of a gesture, in seconds from its beginning.

    Attributes:
        ready: When the preparation ends and the stroke begins.
        stroke: When the stroke arrives, which is to fall on an accent of speech.
        hold: When the hold begins.
        release: When the hold ends and the retraction begins; equal to `hold` without a hold.
            Motion between `hold` and `release` may be repeated.
        end: When the gesture is over.
    """

    ready: float
    stroke: float
    hold: float
    release: float
    end: float

    def __post_init__(self):
        """Checks the order.

        Raises:
            ValueError: If a phase ends before it begins, the stroke arrives at time 0, or the end
                after `LONGEST` seconds.
        """
        order = (0.0, self.ready, self.stroke, self.hold, self.release, self.end)
        ascend = all(a <= b for a, b in pairwise(order))  # not where one is NaN
        if not ascend or self.stroke == 0 or self.end > LONGEST:
            raise ValueError(f"a clip's marks do not ascend, to {LONGEST:g} s at most")


@dataclass(frozen=True, eq=False)
class Clip:
    """A gesture as rotation curves.

    Attributes:
        name: Name of the gesture.
        marks: Times of its phases.
        curves: For each role that it moves, the local rotation from the standard pose over time.
    """

    name: str
    marks: Marks
    curves: dict[str, Curve]

    def __post_init__(self):
        """Checks the names of the roles.

        Raises:
            ValueError: If a role does not exist.
        """
        unknown = sorted(set(self.curves) - set(ROLES))
        if unknown:
            raise ValueError(f"there is no role '{unknown[0]}'")

    @property
    def roles(self) -> NDArray[np.integer]:
        """(M,) indices, in `ROLES`, of the roles that the gesture moves."""
        return np.array([INDEX[role] for role in self.curves], int)

    @cached_property
    def cycle(self) -> float:
        """Duration in seconds of the motion that is repeated in a hold; 0 if the hold is still."""
        marks = self.marks
        held = np.linspace(marks.hold, marks.release, 9)
        moving = any(np.ptp(curve.at(held), axis=0).max() > 1e-2 for curve in self.curves.values())
        return marks.release - marks.hold if moving else 0.0

    def at(self, times: Array | float) -> Array:
        """(..., M, 4) rotations wxyz of the moved roles at times (...) in seconds."""
        if not self.curves:
            return np.zeros((*np.shape(times), 0, 4))
        return np.stack([curve.at(times) for curve in self.curves.values()], -2)

    def mirrored(self) -> "Clip":
        """The mirror image of the gesture: left and right are exchanged."""
        curves = {
            mirrored_role(role): Curve(curve.times, mirrored(curve.rotations))
            for role, curve in self.curves.items()
        }
        return replace(self, curves={role: curves[role] for role in ROLES if role in curves})


def clip_of(
    name: str,
    marks: Marks,
    times: Array,
    poses: Array,
    roles: tuple[str, ...],
    tolerance: float = TOLERANCE,
) -> Clip:
    """Makes a clip from sampled poses.

    Args:
        name: Name of the gesture.
        marks: Times of its phases.
        times: (F,) seconds, ascending from 0.
        poses: (F, R, 4) local rotations by role, wxyz.
        roles: Roles that the gesture moves.
        tolerance: Largest error of the curves at these times, degrees.
    """
    ticks = np.round(times, 3)
    curves = {role: reduced(ticks, continuous(poses[:, INDEX[role]]), tolerance) for role in roles}
    return Clip(name, marks, curves)


def to_bytes(clips: dict[str, Clip]) -> bytes:
    """Clips by name as a safetensors file, see `tensors_of` and `header_of`."""
    return save(tensors_of(clips), {"clips": header_of(clips)})


def tensors_of(clips: dict[str, Clip]) -> dict[str, np.ndarray]:
    """Arrays of a file of clips.

    Returns:
        `CLIP/ROLE/times` (K,) uint16 milliseconds and `CLIP/ROLE/rotations` (K, 4) int16.
    """
    arrays: dict[str, np.ndarray] = {}
    for name, clip in clips.items():
        for role, curve in clip.curves.items():
            ticks, rotations = packed(curve)
            arrays |= {f"{name}/{role}/times": ticks, f"{name}/{role}/rotations": rotations}
    return arrays


def header_of(clips: dict[str, Clip]) -> str:
    """JSON text with version and marks of clips, for the header of their file."""
    marks = {name: vars(clip.marks) for name, clip in clips.items()}
    return json.dumps({"version": VERSION, "marks": marks})


def from_bytes(content: bytes) -> dict[str, Clip]:
    """Clips by name from the content of a file of clips.

    Raises:
        SettingsError: If the file is damaged or does not hold gestures.
    """
    try:
        if len(content) > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES >> 20} MiB")
        about = parse_json(texts_of(content)["clips"].encode(), "clips", ValueError)
        return _clips(cast(dict[str, Any], about), load_bounded(content))
    except (SafetensorError, *_DAMAGE) as error:
        raise SettingsError(f"the file of gestures is damaged ({error}).") from error


def texts_of(content: bytes) -> dict[str, str]:
    """The texts by name in the head of a file of clips.

    Raises:
        ValueError: If the head is larger than those of gestures, or no JSON.
        KeyError: If it has no texts.
    """
    head = cast(dict[str, Any], parse_json(bounded_head(content), "clips", ValueError))
    return head["__metadata__"]


def _clips(about: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, Clip]:
    if about["version"] != VERSION:
        raise ValueError(f"its version is {about['version']}, not {VERSION}")
    curves: dict[str, dict[str, Curve]] = {name: {} for name in about["marks"]}
    if len(curves) > MOST_CLIPS or max(map(len, curves), default=0) > LONGEST_NAME:
        limits = f"at most {MOST_CLIPS}, with names of {LONGEST_NAME} letters"
        raise ValueError(f"it holds {len(curves)} gestures: {limits}, are read")
    for key, rotations in arrays.items():
        name, role, what = key.split("/")
        if what == "rotations":
            curves[name][role] = unpacked(arrays[f"{name}/{role}/times"], rotations)
    return {
        name: Clip(name, Marks(**{k: float(v) for k, v in marks.items()}), _ordered(curves[name]))
        for name, marks in about["marks"].items()
    }


def _ordered(curves: dict[str, Curve]) -> dict[str, Curve]:
    """Curves in the order of `ROLES`; those of unknown roles last, which `Clip` refuses."""
    return dict(sorted(curves.items(), key=lambda item: INDEX.get(item[0], len(ROLES))))


def to_json(clip: Clip) -> str:
    """A clip as JSON: times in milliseconds, rotations as base64 of little-endian int16."""
    curves: dict[str, dict[str, Any]] = {}
    for role, curve in clip.curves.items():
        ticks, rotations = packed(curve)
        data = base64.b64encode(rotations.astype("<i2").tobytes()).decode()
        curves[role] = {"times": ticks.tolist(), "rotations": data}
    about = {"version": VERSION, "name": clip.name, "marks": vars(clip.marks), "curves": curves}
    return json.dumps(about)


def from_json(text: str) -> Clip:
    """The clip of a text that `to_json` wrote.

    Raises:
        SettingsError: If the text is damaged or does not describe a gesture.
    """
    try:
        about = cast(dict[str, Any], parse_json(text.encode(), "the clip", ValueError))
        if about["version"] != VERSION:
            raise ValueError(f"its version is {about['version']}, not {VERSION}")
        curves: dict[str, Curve] = {}
        for role, curve in about["curves"].items():
            rotations = np.frombuffer(base64.b64decode(curve["rotations"]), "<i2").reshape(-1, 4)
            curves[role] = unpacked(np.array(curve["times"], int), rotations)
        marks = Marks(**{k: float(v) for k, v in about["marks"].items()})
        return Clip(str(about["name"]), marks, _ordered(curves))
    except _DAMAGE as error:
        raise SettingsError(f"the clip is damaged ({error}).") from error
