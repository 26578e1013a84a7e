"""Landmarks: points of a body that detectors and annotators know, and their template positions."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Landmark:
    """Position of a landmark on the template.

    Attributes:
        carrier: Name of the joint that carries the landmark.
        bone: Name of the bone at whose end the landmark is; empty if `vertices` place it.
        end: Which end of that bone: `head` or `tail`.
        vertices: Indices of vertices of the base mesh, at whose mean the landmark is.
        sigma: Standard deviation in metres between people of the landmark's offset from the
            template, which is constant for one person.
    """

    carrier: str
    bone: str = ""
    end: str = "head"
    vertices: tuple[int, ...] = ()
    sigma: float = 0.02


FINGERS = ("thumb", "index", "middle", "ring", "little")


def _hand(side: str) -> dict[str, Landmark]:
    """The 20 landmarks of a hand without its wrist: four of each finger, from root to tip."""
    found = {}
    for number, finger in enumerate(FINGERS, 1):
        bones = [f"finger{number}-{part}.{side}" for part in (1, 2, 3)]
        root = f"wrist.{side}" if number == 1 else f"metacarpal{number - 1}.{side}"
        for part, (bone, carrier) in enumerate(zip(bones, [root, *bones], strict=False), 1):
            found[f"{finger}{part}.{side}"] = Landmark(carrier, bone, sigma=0.006)
        found[f"{finger}4.{side}"] = Landmark(bones[2], bones[2], "tail", sigma=0.008)
    return found


def _side(
    side: str, ear: int, mouth: int, inner: int, outer: int, heel: int
) -> dict[str, Landmark]:
    """The landmarks of one side of the body.

    Args:
        side: `L` or `R`.
        ear: Vertex of the base mesh at the ear.
        mouth: Vertex at the corner of the mouth.
        inner: Vertex at the inner corner of the eye.
        outer: Vertex at the outer corner of the eye.
        heel: Vertex at the heel.
    """
    head = "head"

    return {
        f"eye.{side}": Landmark(head, f"eye.{side}", sigma=0.012),
        f"eye_inner.{side}": Landmark(head, vertices=(inner,), sigma=0.01),
        f"eye_outer.{side}": Landmark(head, vertices=(outer,), sigma=0.01),
        f"ear.{side}": Landmark(head, vertices=(ear,), sigma=0.03),
        f"mouth.{side}": Landmark(head, vertices=(mouth,), sigma=0.012),
        f"shoulder.{side}": Landmark(f"shoulder01.{side}", f"upperarm01.{side}", sigma=0.015),
        f"elbow.{side}": Landmark(f"upperarm02.{side}", f"lowerarm01.{side}", sigma=0.012),
        f"wrist.{side}": Landmark(f"lowerarm02.{side}", f"wrist.{side}", sigma=0.01),
        f"hip.{side}": Landmark("root", f"upperleg01.{side}", sigma=0.025),
        f"knee.{side}": Landmark(f"upperleg02.{side}", f"lowerleg01.{side}", sigma=0.015),
        f"ankle.{side}": Landmark(f"lowerleg02.{side}", f"foot.{side}", sigma=0.012),
        f"heel.{side}": Landmark(f"foot.{side}", vertices=(heel,), sigma=0.02),
        f"toe.{side}": Landmark(f"foot.{side}", f"toe1-2.{side}", "tail", sigma=0.02),
        f"little_toe.{side}": Landmark(f"foot.{side}", f"toe5-3.{side}", "tail", sigma=0.02),
    } | _hand(side)


LANDMARKS = {
    "nose": Landmark("head", vertices=(5054,), sigma=0.012),
    **_side("L", 7576, 10404, 11489, 13377, 12442),
    **_side("R", 871, 3736, 4871, 6781, 5845),
}
"""All P landmarks by name; `.L` is the person's left side, `.R` the right one."""
