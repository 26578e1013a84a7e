"""What a gesture is written in: where hands go, in the person's own proportions, and when."""

from dataclasses import dataclass, field

Vector = tuple[float, float, float]
"""Outwards (away from the other hand), upwards, forwards."""


@dataclass(frozen=True)
class Reach:
    """Where a hand is.

    Attributes:
        place: Where the hand goes from the anchor, in arm lengths (shoulder to wrist).
        elbow: Where the elbow points.
        fingers: Where straight fingers would point.
        palm: Where the palm looks.
        shape: What fingers do: a key of `SHAPES`.
        anchor: `shoulder` (of the same side), `chest` (the breastbone) or `chin`.
        part: What of the hand is there: 0 the wrist, 1 the knuckles, 2 the tips of its fingers.
    """

    place: Vector
    elbow: Vector
    fingers: Vector
    palm: Vector
    shape: str = "loose"
    anchor: str = "shoulder"
    part: float = 0.0


HANG = None
"""Instead of a `Reach`: the arm hangs."""


@dataclass(frozen=True)
class Lean:
    """How torso and head are turned.

    Attributes:
        chest: Degrees forwards, to the person's left, and towards the right shoulder.
        head: The same of the head against the chest.
        shrug: Degrees that collarbones lift beyond what the arms ask for.
    """

    chest: Vector = (0.0, 0.0, 0.0)
    head: Vector = (0.0, 0.0, 0.0)
    shrug: float = 0.0


@dataclass(frozen=True)
class Script:
    """A gesture of the right hand, of both, or of the head.

    Attributes:
        ready: Seconds when the preparation is over and the stroke begins.
        stroke: The stroke's moment: when it arrives.
        hold: Seconds from and to which the end of the stroke is held, or repeated where what is
            between moves.
        end: Seconds when everything is back.
        right: (seconds, where) of the right hand, minimum-jerk movements between them.
        left: Of the left hand.
        lean: Of torso and head.
    """

    ready: float
    stroke: float
    hold: tuple[float, float]
    end: float
    right: tuple[tuple[float, Reach | None], ...] = ()
    left: tuple[tuple[float, Reach | None], ...] = ()
    lean: tuple[tuple[float, Lean], ...] = field(default=())
