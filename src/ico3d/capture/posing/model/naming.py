"""Maps points of MediaPipe and COCO-WholeBody to names of the template's landmarks."""

from ico3d.capture.posing.model.landmarks import FINGERS


def _both(*names: str) -> tuple[str, ...]:
    """For each name the landmarks of the left and of the right side."""
    return tuple(f"{name}.{side}" for name in names for side in ("L", "R"))


def hand(side: str) -> tuple[str, ...]:
    """Landmarks of the 21 points of a hand, in the order of MediaPipe and of COCO-WholeBody."""
    return (f"wrist.{side}", *(f"{f}{part}.{side}" for f in FINGERS for part in (1, 2, 3, 4)))


_EYES = ("eye_inner", "eye", "eye_outer")
MEDIAPIPE_POSE = (
    "nose",
    *(f"{eye}.L" for eye in _EYES),
    *(f"{eye}.R" for eye in _EYES),
    *_both("ear", "mouth", "shoulder", "elbow", "wrist", "little1", "index1", "thumb3"),
    *_both("hip", "knee", "ankle", "heel", "toe"),
)
"""Landmarks of MediaPipe's 33 points of a body, in its order."""

_FACE = {36: "eye_outer.R", 39: "eye_inner.R", 42: "eye_inner.L", 45: "eye_outer.L"}
_FACE |= {48: "mouth.R", 54: "mouth.L"}
_FACE_FIRST = 23
COCO_WHOLE_BODY: dict[int, str] = {
    **dict(enumerate(("nose", *_both("eye", "ear", "shoulder", "elbow", "wrist")))),
    **dict(enumerate(_both("hip", "knee", "ankle"), 11)),
    **dict(enumerate([f"{name}.L" for name in ("toe", "little_toe", "heel")], 17)),
    **dict(enumerate([f"{name}.R" for name in ("toe", "little_toe", "heel")], 20)),
    **{_FACE_FIRST + number: name for number, name in _FACE.items()},
    **dict(enumerate(hand("L")[1:], 92)),
    **dict(enumerate(hand("R")[1:], 113)),
}
"""Landmarks by the index of the point among the 133 points of COCO-WholeBody.

Points without a landmark are missing; wrists are taken from the body, not from the hands.
"""

MIRRORED = {"L": "R", "R": "L"}
"""The other side of each side."""


def opposite(name: str) -> str:
    """The same landmark on the other side; one in the middle is returned as it is."""
    plain, dot, side = name.partition(".")
    return f"{plain}.{MIRRORED[side]}" if dot else name
