"""How human joints can turn: axes of each joint, usual angles, and stops.

A joint's rotation vector is given along three axes at rest: *bend* (the axis of a hinge; positive
angles bend as knees, elbows and fingers do), *side*, and *twist* (along the bone).
"""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.posing.model.template import Template

Vector = tuple[float, float, float]
OPEN = (-9.0, 9.0)
"""Range of bending, in radians, of a joint without stops."""


@dataclass(frozen=True)
class Freedom:
    """How a joint can turn.

    Attributes:
        spread: Standard deviation of the angles of bend, side and twist, radians.
        bend: Least and largest angle of bend, radians.
        pace: Usual change, from one tenth of a second to the next, of the angle by which the joint
            turns in it, radians.
    """

    spread: Vector
    bend: tuple[float, float] = OPEN
    pace: float = 0.10


STIFF = 0.02
"""Standard deviation in radians about an axis about which a joint hardly turns."""
FREEDOMS = {
    "root": Freedom((9.0, 9.0, 9.0), pace=0.06),
    "spine": Freedom((0.15, 0.12, 0.12), pace=0.03),
    "neck": Freedom((0.2, 0.15, 0.2), pace=0.04),
    "head": Freedom((0.25, 0.2, 0.3), pace=0.06),
    "clavicle": Freedom((0.15, 0.15, 0.05), pace=0.04),
    "shoulder01": Freedom((0.15, 0.15, 0.05), pace=0.04),
    "upperarm01": Freedom((1.5, 1.5, 0.8), pace=0.15),
    "upperarm02": Freedom((STIFF, STIFF, 0.5), pace=0.10),
    "lowerarm01": Freedom((1.0, 0.05, 0.2), (-0.85, 1.9), pace=0.15),
    "lowerarm02": Freedom((STIFF, STIFF, 0.8), pace=0.12),
    "wrist": Freedom((0.5, 0.3, 0.1), pace=0.12),
    "metacarpal": Freedom((0.06, 0.06, STIFF), pace=0.03),
    "finger1-1": Freedom((0.3, 0.3, 0.2), pace=0.08),
    "finger1-2": Freedom((0.3, 0.08, 0.05), (-0.4, 1.2), pace=0.08),
    "finger1-3": Freedom((0.4, STIFF, STIFF), (-0.5, 1.4), pace=0.08),
    "finger-1": Freedom((0.5, 0.15, 0.05), (-0.6, 1.7), pace=0.10),
    "finger-2": Freedom((0.5, STIFF, STIFF), (-0.3, 1.9), pace=0.10),
    "finger-3": Freedom((0.3, STIFF, STIFF), (-0.3, 1.4), pace=0.10),
    "upperleg01": Freedom((0.8, 0.4, 0.4), pace=0.08),
    "upperleg02": Freedom((STIFF, STIFF, 0.3), pace=0.05),
    "lowerleg01": Freedom((0.9, 0.05, 0.1), (-0.2, 2.6), pace=0.10),
    "lowerleg02": Freedom((STIFF, STIFF, 0.2), pace=0.05),
    "foot": Freedom((0.4, 0.2, 0.2), pace=0.08),
}
"""Freedoms by the beginning of joints' names; `finger-` stands for the four fingers but the thumb.
"""


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Axes and freedoms of J joints.

    Attributes:
        axes: (J, 3, 3) columns are the unit axes of bend, side and twist in rest space.
        spread: (J, 3) `Freedom.spread`, radians.
        bend: (J, 2) `Freedom.bend`, radians.
        pace: (J,) `Freedom.pace`, radians.
    """

    axes: np.ndarray
    spread: np.ndarray
    bend: np.ndarray
    pace: np.ndarray


def anatomy_of(template: Template) -> Anatomy:
    """Axes and freedoms of the template's joints, measured on its mean shape."""
    hinges = _hinges(template)
    axes, freedoms = [], []
    for joint, name in enumerate(template.names):
        along = template.tails[0, joint] - template.joints[0, joint]
        freedom = freedom_of(name)
        hinge = hinges.get(name.replace("upperarm", "lowerarm"), np.array([1.0, 0.0, 0.0]))
        axes.append(np.eye(3) if name == "root" else _frame(along, hinge))
        freedoms.append(freedom)
    return Anatomy(
        np.stack(axes),
        np.array([freedom.spread for freedom in freedoms]),
        np.array([freedom.bend for freedom in freedoms]),
        np.array([freedom.pace for freedom in freedoms]),
    )


def freedom_of(name: str) -> Freedom:
    """The freedom of a joint by its name: that of the longest key with which the name begins."""
    plain = name.split(".")[0]
    if plain.startswith("finger") and not plain.startswith("finger1"):
        plain = "finger" + plain[7:]
    matching = [key for key in FREEDOMS if plain.startswith(key)]
    return FREEDOMS[max(matching, key=len)]


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """(3, 3) orthonormal columns: bend (near `hinge`), side, and twist (along the bone `along`)."""
    twist = along / np.linalg.norm(along)
    bend = hinge - (hinge @ twist) * twist
    bend /= np.linalg.norm(bend)
    return np.stack([bend, np.cross(twist, bend), twist], 1)


def _hinges(template: Template) -> dict[str, np.ndarray]:
    """Axes (3,) of any length about which joints of arms, hands and fingers bend, by name.

    Joints that are missing here bend about the x axis.
    """
    at = dict(zip(template.names, template.joints[0], strict=True))
    ends = dict(zip(template.names, template.tails[0], strict=True))
    found = {}
    for side in ("L", "R"):
        elbow, wrist = at[f"lowerarm01.{side}"], at[f"wrist.{side}"]
        bent = np.cross(elbow - at[f"upperarm01.{side}"], wrist - elbow)
        found |= {f"lowerarm0{part}.{side}": bent for part in (1, 2)}
        bends = []
        for finger in range(2, 6):
            middle = at[f"finger{finger}-2.{side}"]
            first = middle - at[f"finger{finger}-1.{side}"]
            bends.append(np.cross(first, ends[f"finger{finger}-3.{side}"] - middle))
        across = at[f"finger2-1.{side}"] - at[f"finger5-1.{side}"]
        across = across * np.sign(across @ np.sum(bends, 0))
        bones = (*(f"finger{finger}-{part}" for finger in range(2, 6) for part in (1, 2, 3)),)
        bones += ("wrist", *(f"metacarpal{number}" for number in (1, 2, 3, 4)))
        found |= {f"{bone}.{side}": across for bone in bones}
        tip, root = ends[f"finger1-3.{side}"], at[f"finger1-1.{side}"]
        knuckle = at[f"finger1-2.{side}"]
        found |= {
            f"finger1-{part}.{side}": np.cross(knuckle - root, tip - knuckle) for part in (1, 2, 3)
        }
    return found
