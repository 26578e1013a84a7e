"""Points of a body that detectors and annotators name, and where on the template they are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Landmark:
    """Where a named point is before a fit moves it.

    Attributes:
        carrier: The joint that carries it.
        bone: The bone at whose end it is; empty where vertices tell.
        end: `head` or `tail` of that bone.
        vertices: Numbers of vertices of the base mesh; it is at their mean.
        sigma: Metres by which a person's may lie elsewhere, always by the same way.
    """

    carrier: str
    bone: str = ""
    end: str = "head"
    vertices: tuple[int, ...] = ()
    sigma: float = 0.02


FINGERS = ("thumb", "index", "middle", "ring", "little")


def _hand(side: str) -> dict[str, Landmark]:
    """The 21 points of a hand: wrist, then four of each finger from its root to its tip."""
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
    """The points of one side of the body; numbers are vertices of the base mesh."""
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
"""All of them by name; L is the person's left."""
