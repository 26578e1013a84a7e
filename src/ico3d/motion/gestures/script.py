"""The form in which gestures are written: where hands are when, in a person's own proportions."""

from dataclasses import dataclass, field

Vector = tuple[float, float, float]
"""Three coordinates; for hands: outwards (away from the other hand), upwards, forwards."""


@dataclass(frozen=True)
class Reach:
    """Position, orientation and shape of a hand.

    Attributes:
        place: Position relative to the anchor, in arm lengths (shoulder to wrist).
        elbow: Direction in which the elbow points.
        fingers: Direction in which straight fingers would point.
        palm: Direction in which the palm looks.
        shape: Shape of the fingers, a key of `SHAPES`.
        anchor: `shoulder` (of the same side), `chest` (the breastbone) or `chin`.
        part: The part of the hand that is at `place`: 0 the wrist, 1 the knuckles, 2 the
            fingertips, and points between.
    """

    place: Vector
    elbow: Vector
    fingers: Vector
    palm: Vector
    shape: str = "loose"
    anchor: str = "shoulder"
    part: float = 0.0


HANG = None
"""Stands for a hanging arm in the place of a `Reach`."""


@dataclass(frozen=True)
class Lean:
    """Rotation of torso and head.

    Attributes:
        chest: Degrees forwards, to the person's left, and towards the right shoulder.
        head: Degrees of the head relative to the chest, likewise.
        shrug: Degrees by which collarbones are lifted, in addition to what lifted arms need.
    """

    chest: Vector = (0.0, 0.0, 0.0)
    head: Vector = (0.0, 0.0, 0.0)
    shrug: float = 0.0


@dataclass(frozen=True)
class Script:
    """A gesture of the right hand, of both, or of the head.

    Attributes:
        ready: Time at which the preparation ends and the stroke begins, seconds.
        stroke: Time at which the stroke arrives, seconds.
        hold: Beginning and end of the hold, seconds; motion in between is repeated.
        end: Time at which arms hang again, seconds.
        right: Keys of the right hand: times in seconds, and where the hand is. Movements between
            keys have minimum jerk.
        left: Keys of the left hand.
        lean: Keys of torso and head.
    """

    ready: float
    stroke: float
    hold: tuple[float, float]
    end: float
    right: tuple[tuple[float, Reach | None], ...] = ()
    left: tuple[tuple[float, Reach | None], ...] = ()
    lean: tuple[tuple[float, Lean], ...] = field(default=())
