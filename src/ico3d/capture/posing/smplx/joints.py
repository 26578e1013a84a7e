"""Names of SMPL-X's joints, and which of them the key points of COCO-WholeBody mark."""

from ico3d.capture.posing.model.naming import COCO_WHOLE_BODY

SIDES = {"L": "left", "R": "right"}
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
"""Joints of arms and legs that have the same name in SMPL-X and among the key points."""


def _both(*names: str) -> tuple[str, ...]:
    """For each name the joints of the left and of the right side."""
    return tuple(f"{side}_{name}" for name in names for side in SIDES.values())


NAMES = (
    *("pelvis", *_both("hip"), "spine1", *_both("knee"), "spine2", *_both("ankle"), "spine3"),
    *(*_both("foot"), "neck", *_both("collar"), "head", *_both("shoulder", "elbow", "wrist")),
    *("jaw", *_both("eye_smplhf")),
    *(f"{side}_{finger}{n}" for side in SIDES.values() for finger in FINGERS for n in (1, 2, 3)),
)
"""Names of the 55 joints, in the order of the model's files."""

HANDS = {"hands_meanl": slice(25, 40), "hands_meanr": slice(40, 55)}
"""The 15 joints of each hand, by the name of the array that holds the hand's mean pose."""

MARKED = {
    number: NAMES.index(f"{SIDES[name[-1]]}_{name[:-2]}")
    for number, name in COCO_WHOLE_BODY.items()
    if name[:-2] in PARTS
}
"""Index of the joint at a key point, by the key point's index in COCO-WholeBody."""
