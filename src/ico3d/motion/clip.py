"""A gesture as rotation curves by role, and the file of several of them."""

import base64
import json
import re
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from ico3d.common.typed import parse_json
from ico3d.errors import SettingsError
from ico3d.motion.curves import TOLERANCE, Curve, packed, reduced, unpacked
from ico3d.motion.roles import INDEX, ROLES, SIDES, mirrored_role
from ico3d.motion.turning import mirrored
from ico3d.rig.quaternions import Array, continuous

VERSION = 1


def meaning(name: str) -> str:
    """What a clip means: its name without the number that tells several alike apart."""
    return re.sub(r"_\d+$", "", name)


def other_hand(meant: str) -> str:
    """The meaning of the same gesture made with the other hand: `beat_left` of `beat_right`."""
    gesture, _, side = meant.rpartition("_")
    return f"{gesture}_{SIDES[1 - SIDES.index(side)]}" if side in SIDES else meant


@dataclass(frozen=True)
class Marks:
    """The phases of a gesture; seconds.

    Attributes:
        ready: When the preparation is over and the stroke begins.
        stroke: When the stroke arrives: what is to fall on an accent.
        hold: When the hold begins.
        release: When the hold is over and the retraction begins; between `hold` and here it may
            be gone round again. Equal to `hold` where there is none.
        end: When all is over.
    """

    ready: float
    stroke: float
    hold: float
    release: float
    end: float

    def __post_init__(self):
        """Checks the order.

        Raises:
            ValueError: If a phase ends before it begins.
        """
        order = (0.0, self.ready, self.stroke, self.hold, self.release, self.end)
        if not all(a <= b for a, b in pairwise(order)):  # also where one is NaN
            raise ValueError("a clip's marks do not ascend")


@dataclass(frozen=True, eq=False)
class Clip:
    """A gesture.

    Attributes:
        name: What it means.
        marks: Its phases.
        curves: Of the roles that it moves, from the standard pose.
    """

    name: str
    marks: Marks
    curves: dict[str, Curve]

    def __post_init__(self):
        """Checks the roles.

        Raises:
            ValueError: If there is none of a name.
        """
        unknown = sorted(set(self.curves) - set(ROLES))
        if unknown:
            raise ValueError(f"there is no role '{unknown[0]}'")

    @property
    def roles(self) -> NDArray[np.integer]:
        """(M,) numbers of the roles that it moves."""
        return np.array([INDEX[role] for role in self.curves], int)

    def at(self, times: Array | float) -> Array:
        """(..., M, 4) of its roles at seconds (...)."""
        return np.stack([curve.at(times) for curve in self.curves.values()], -2)

    def mirrored(self) -> "Clip":
        """The same with the other hand."""
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
    """A clip of poses.

    Args:
        name: What it means.
        marks: Its phases.
        times: (F,) seconds, ascending from 0.
        poses: (F, R, 4) by role.
        roles: Those that it moves.
        tolerance: Degrees that a curve may be off.
    """
    ticks = np.round(times, 3)
    curves = {role: reduced(ticks, continuous(poses[:, INDEX[role]]), tolerance) for role in roles}
    return Clip(name, marks, curves)


def to_bytes(clips: dict[str, Clip]) -> bytes:
    """A safetensors file: `CLIP/ROLE/times` uint16 ms and `CLIP/ROLE/rotations` int16."""
    return save(tensors_of(clips), {"clips": header_of(clips)})


def tensors_of(clips: dict[str, Clip]) -> dict[str, np.ndarray]:
    """The arrays of such a file."""
    arrays: dict[str, np.ndarray] = {}
    for name, clip in clips.items():
        for role, curve in clip.curves.items():
            ticks, rotations = packed(curve)
            arrays |= {f"{name}/{role}/times": ticks, f"{name}/{role}/rotations": rotations}
    return arrays


def header_of(clips: dict[str, Clip]) -> str:
    """JSON in the header of such a file."""
    marks = {name: vars(clip.marks) for name, clip in clips.items()}
    return json.dumps({"version": VERSION, "marks": marks})


def from_bytes(content: bytes) -> dict[str, Clip]:
    """The clips of a file.

    Raises:
        SettingsError: If it is damaged or holds what is no gesture.
    """
    try:
        size = int.from_bytes(content[:8], "little")
        header = cast(dict[str, Any], parse_json(content[8 : 8 + size], "clips", ValueError))
        arrays = load(content)
        about = parse_json(header["__metadata__"]["clips"].encode(), "clips", ValueError)
        return _clips(cast(dict[str, Any], about), arrays)
    except (SafetensorError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SettingsError(f"the file of gestures is damaged ({error}).") from error


def _clips(about: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, Clip]:
    if about["version"] != VERSION:
        raise ValueError(f"its version is {about['version']}, not {VERSION}")
    curves: dict[str, dict[str, Curve]] = {name: {} for name in about["marks"]}
    for key, rotations in arrays.items():
        name, role, what = key.split("/")
        if what == "rotations":
            curves[name][role] = unpacked(arrays[f"{name}/{role}/times"], rotations)
    return {
        name: Clip(name, Marks(**{k: float(v) for k, v in marks.items()}), _ordered(curves[name]))
        for name, marks in about["marks"].items()
    }


def _ordered(curves: dict[str, Curve]) -> dict[str, Curve]:
    """The curves in the order of the roles; those of no role last, to be refused."""
    return dict(sorted(curves.items(), key=lambda item: INDEX.get(item[0], len(ROLES))))


def to_json(clip: Clip) -> str:
    """A clip as text: times in milliseconds, int16 rotations in base64, little end first."""
    curves: dict[str, dict[str, Any]] = {}
    for role, curve in clip.curves.items():
        ticks, rotations = packed(curve)
        data = base64.b64encode(rotations.astype("<i2").tobytes()).decode()
        curves[role] = {"times": ticks.tolist(), "rotations": data}
    about = {"version": VERSION, "name": clip.name, "marks": vars(clip.marks), "curves": curves}
    return json.dumps(about)


def from_json(text: str) -> Clip:
    """The clip of a text.

    Raises:
        SettingsError: If it is damaged or holds what is no gesture.
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
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SettingsError(f"the clip is damaged ({error}).") from error
