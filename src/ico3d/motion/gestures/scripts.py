"""The gestures that ship with the package."""

from dataclasses import replace

from ico3d.motion.gestures.script import HANG, Lean, Reach, Script

Key = tuple[float, Reach | None]
"""A time in seconds, and where a hand is; None where the arm hangs."""
AHEAD = 0.06
"""Seconds by which the right one of two hands leads: nobody moves both as if by one string."""


def _once(
    ready: Reach, stroke: Reach, up: float, swing: float, hold: float, down: float
) -> tuple[Key, ...]:
    """Keys of a hand with one stroke from `ready` to `stroke`.

    The hand is raised in `up` seconds; the stroke takes `swing` seconds, the hold `hold` seconds;
    and the hand is lowered in `down` seconds.
    """
    ends = [0.0, up, up + swing, up + swing + hold, up + swing + hold + down]
    return tuple(zip(ends, (HANG, ready, stroke, stroke, HANG), strict=True))


def _script(
    up: float,
    swing: float,
    hold: float,
    down: float,
    right: tuple[Reach, Reach] | None = None,
    left: tuple[Reach, Reach] | None = None,
    lean: Lean | None = None,
) -> Script:
    """A gesture with one stroke; of two hands the right one leads.

    Args:
        up: Duration of the preparation, seconds.
        swing: Duration of the stroke, seconds.
        hold: Duration of the hold, seconds.
        down: Duration of the retraction, seconds.
        right: Where the right hand begins and ends the stroke; None leaves it hanging.
        left: Likewise of the left hand.
        lean: Torso and head at the end of the stroke; None leaves them as they are.
    """
    ahead = AHEAD if right and left else 0.0
    hands = [
        _once(*pair, up - before, swing, hold + before, down) if pair else ()
        for pair, before in ((right, ahead), (left, 0.0))
    ]
    stroke = up + swing
    leaning: tuple[tuple[float, Lean], ...] = ()
    if lean is not None:
        leaning = (
            *((0.0, Lean()), (0.5 * up, Lean()), (stroke, lean)),
            *((stroke + hold, lean), (stroke + hold + 0.8 * down, Lean())),
        )
    return Script(
        up, stroke, (stroke, stroke + hold), stroke + hold + down, hands[0], hands[1], leaning
    )


def _second(hand: Reach) -> Reach:
    """Where the second of two hands is: lower, nearer to the body, turned a little inwards."""
    outwards, up, forwards = hand.place
    finger = hand.fingers
    return replace(
        hand,
        place=(outwards - 0.03, up - 0.06, forwards - 0.07),
        fingers=(finger[0] - 0.12, finger[1] + 0.10, finger[2]),
    )


def _both(
    up: float,
    swing: float,
    hold: float,
    down: float,
    hands: tuple[Reach, Reach],
    lean: Lean | None = None,
) -> Script:
    """A gesture with one stroke of both hands, from and to the same places of each side."""
    second = _second(hands[0]), _second(hands[1])
    return _script(up, swing, hold, down, right=hands, left=second, lean=lean)


# Hands of somebody who is seen across a table are before the chest: lower ones would be hidden.
_ELBOW = (0.28, -0.90, -0.33)

# The elbow is beside the trunk, under the hand: an arm that points at who looks has no bones.
_WAVE = Reach((0.11, 0.13, 0.34), (0.42, -0.9, -0.4), (0.05, 1.0, 0.06), (-0.05, 0.0, 1.0), "open")
_WAVE_IN = replace(_WAVE, place=(0.09, 0.12, 0.34), fingers=(-0.34, 1.0, 0.06))
_WAVE_OUT = replace(_WAVE, place=(0.13, 0.12, 0.34), fingers=(0.36, 1.0, 0.06))

_AIM = Reach((0.14, -0.34, 0.40), (0.55, -0.82, -0.3), (-0.1, 0.25, 1.0), (-0.8, -0.6, 0.1))
_POINT = Reach((-0.03, -0.10, 0.83), _ELBOW, (-0.06, 0.06, 1.0), (-0.55, -0.83, 0.0), "point")

_GATHER = Reach((0.02, -0.30, 0.46), _ELBOW, (-0.15, 0.25, 1.0), (-1.0, 0.25, 0.0))
_OPEN = Reach((0.24, -0.32, 0.52), _ELBOW, (0.38, 0.12, 1.0), (-0.42, 1.0, 0.1), "offering")
_OFFER = Reach((0.10, -0.28, 0.60), _ELBOW, (0.12, 0.15, 1.0), (-0.35, 1.0, 0.0), "offering")
_BEFORE_OFFER = Reach((0.00, -0.26, 0.42), _ELBOW, (-0.3, 0.35, 0.9), (-0.9, 0.3, -0.1))

_COUNT = Reach((0.16, -0.10, 0.46), (0.45, -0.88, -0.1), (-0.05, 1.0, 0.18), (-0.3, -0.1, 1.0))
_FIST = Reach(
    (0.17, -0.24, 0.42), (0.45, -0.88, -0.1), (-0.1, 1.0, 0.3), (-0.45, -0.2, 1.0), "fist"
)

_SHRUG = Reach(
    (0.30, -0.42, 0.40), (0.3, -0.85, -0.45), (0.75, 0.12, 0.7), (0.0, 1.0, 0.25), "open"
)
_BEFORE_SHRUG = Reach((0.10, -0.46, 0.40), (0.4, -0.85, -0.4), (0.2, 0.1, 1.0), (-0.9, 0.5, 0.1))

_THINK = Reach(
    *((0.03, -0.10, 0.03), (0.5, -1.0, 0.15), (-0.45, 0.9, -0.12), (-0.35, -0.25, -0.9), "chin"),
    anchor="chin",
    part=1.15,
)

_RAISED = Reach((-0.07, -0.19, 0.37), _ELBOW, (-0.1, 0.45, 1.0), (-0.85, -0.35, 0.1))
_BEATEN = Reach((0.00, -0.37, 0.40), _ELBOW, (-0.05, 0.05, 1.0), (-0.95, 0.15, 0.0))
_LOW = Reach((0.06, -0.36, 0.40), _ELBOW, (-0.35, 0.25, 0.9), (-0.75, 0.6, 0.1))
_SHOWN = Reach((0.20, -0.44, 0.46), _ELBOW, (0.05, 0.05, 1.0), (-0.8, 0.5, 0.1), "offering")
_INSIDE = Reach((-0.04, -0.24, 0.40), _ELBOW, (-0.6, 0.35, 0.75), (-0.75, -0.1, -0.6))
_OUTSIDE = Reach((0.30, -0.26, 0.42), _ELBOW, (0.15, 0.4, 0.9), (-0.8, 0.3, 0.5), "open")
_LIFTED = Reach((0.10, -0.10, 0.42), _ELBOW, (-0.25, 0.75, 0.7), (-0.75, -0.5, 0.5), "pinch")
_SET = Reach((0.10, -0.24, 0.52), _ELBOW, (-0.2, 0.35, 0.9), (-0.75, -0.55, 0.3), "pinch")

_HEART = Reach(
    *((-0.08, -0.02, 0.045), (0.8, -0.6, 0.12), (-1.0, 0.32, 0.06), (0.06, 0.05, -1.0), "flat"),
    anchor="chest",
    part=0.85,
)
_BEFORE_HEART = replace(_HEART, place=(-0.02, -0.06, 0.26), fingers=(-1.0, 0.4, 0.4))

_WELCOME = Reach((0.52, -0.32, 0.50), _ELBOW, (0.62, 0.18, 0.75), (-0.35, 0.75, 0.55), "open")
_BEFORE_WELCOME = Reach((0.12, -0.36, 0.48), _ELBOW, (-0.1, 0.3, 1.0), (-0.8, 0.5, 0.0))

_BIG = Reach((0.48, -0.22, 0.52), (0.7, -0.7, -0.2), (-0.05, 0.35, 1.0), (-1.0, 0.0, 0.1), "open")
_BEFORE_BIG = replace(_BIG, place=(0.02, -0.30, 0.50), shape="loose")
_SMALL = Reach((-0.08, -0.24, 0.50), _ELBOW, (-0.1, 0.3, 1.0), (-1.0, 0.0, 0.1), "flat")
_BEFORE_SMALL = replace(_SMALL, place=(0.22, -0.26, 0.50), shape="loose")


def _wave() -> Script:
    up, half, down = 0.7, 0.24, 0.8
    swings = (_WAVE_OUT, _WAVE_IN, _WAVE_OUT, _WAVE_IN)
    right: list[Key] = [(0.0, HANG)]
    right += [(up + half * i, swing) for i, swing in enumerate(swings)]
    last = up + half * (len(swings) - 1)
    lean = Lean(head=(-1.0, 0.0, 4.0))
    return Script(
        ready=up,
        stroke=up + half,
        hold=(up + half, last),
        end=last + down,
        right=(*right, (last + down, HANG)),
        lean=((0.0, Lean()), (up, lean), (last, lean), (last + 0.8 * down, Lean())),
    )


def _turning(angles: tuple[tuple[float, float], ...], column: int, stroke: int) -> Script:
    """Rotations of the head about one axis.

    Args:
        angles: Times in seconds, and degrees.
        column: Axis, an index of `Lean.head`.
        stroke: Index of the angle with which the stroke arrives.
    """
    keys: list[tuple[float, Lean]] = []
    for seconds, degrees in angles:
        turn = [0.0, 0.0, 0.0]
        turn[column] = degrees
        keys.append((seconds, Lean(head=(turn[0], turn[1], turn[2]))))
    at = angles[stroke][0]
    return Script(angles[stroke - 1][0], at, (at, at), angles[-1][0], lean=tuple(keys))


def _count(shape: str) -> Script:
    return _script(0.55, 0.22, 0.4, 0.75, right=(_FIST, replace(_COUNT, shape=shape)))


_NOD = ((0.0, 0.0), (0.14, -2.0), (0.38, 10.0), (0.62, 0.5), (0.84, 6.0), (1.15, 0.0))
_SMALL_NOD = ((0.0, 0.0), (0.3, 6.0), (0.7, 0.0))
_SHAKE = ((0.0, 0.0), (0.26, -12.0), (0.56, 12.0), (0.84, -9.0), (1.1, 5.0), (1.4, 0.0))
_TELLING = Lean(chest=(1.5, 0.0, 0.0), head=(2.0, 0.0, 0.0))
_ASIDE = Lean(chest=(0.5, -2.0, 0.0), head=(0.0, 1.0, 3.0))

SCRIPTS = {
    "wave": _wave(),
    "point": _script(0.55, 0.28, 0.45, 0.85, right=(_AIM, _POINT), lean=Lean((2.0, 3.0, 0.0))),
    "open_hands": _both(0.55, 0.32, 0.4, 0.85, (_GATHER, _OPEN), _TELLING),
    "open_hand": _script(
        *(0.5, 0.32, 0.4, 0.8), right=(_BEFORE_OFFER, _OFFER), lean=Lean((1.5, 3.0, 0.0))
    ),
    "count_one": _count("one"),
    "count_two": _count("two"),
    "count_three": _count("three"),
    "shrug": _both(
        *(0.4, 0.3, 0.45, 0.75, (_BEFORE_SHRUG, _SHRUG)),
        Lean((-1.0, 0.0, 0.0), (-2.0, 0.0, 7.0), 18.0),
    ),
    "nod": _turning(_NOD, 0, 2),
    "small_nod": _turning(_SMALL_NOD, 0, 1),
    "shake": _turning(_SHAKE, 1, 1),
    "think": _script(
        *(0.7, 0.3, 1.0, 0.9),
        right=(replace(_THINK, place=(0.04, -0.08, 0.16)), _THINK),
        lean=Lean((0.0, 0.0, -1.0), (2.0, 7.0, -4.0)),
    ),
    "beat_right": _script(0.45, 0.2, 0.25, 0.75, right=(_RAISED, _BEATEN)),
    "beat_right_2": _script(0.42, 0.24, 0.3, 0.75, right=(_LOW, _SHOWN)),
    "beat_right_3": _script(0.48, 0.26, 0.25, 0.8, right=(_INSIDE, _OUTSIDE), lean=_ASIDE),
    "beat_right_4": _script(0.5, 0.2, 0.3, 0.8, right=(_LIFTED, _SET)),
    "beat_left": _script(0.45, 0.2, 0.25, 0.75, left=(_RAISED, _BEATEN)),
    "beat_left_2": _script(0.42, 0.24, 0.3, 0.75, left=(_LOW, _SHOWN)),
    "beat_both": _both(0.48, 0.22, 0.25, 0.8, (_RAISED, _BEATEN), _TELLING),
    "beat_both_2": _script(
        *(0.5, 0.26, 0.25, 0.8), right=(_INSIDE, _OUTSIDE), left=(_LOW, _SHOWN), lean=_TELLING
    ),
    "hand_on_heart": _script(
        *(0.6, 0.3, 0.7, 0.85),
        right=(_BEFORE_HEART, _HEART),
        lean=Lean((1.0, 0.0, 0.0), (5.0, 0.0, 0.0)),
    ),
    "welcome": _both(
        *(0.55, 0.38, 0.5, 0.9, (_BEFORE_WELCOME, _WELCOME)),
        Lean((-1.5, 0.0, 0.0), (2.0, 0.0, 0.0)),
    ),
    "big": _both(0.5, 0.38, 0.4, 0.85, (_BEFORE_BIG, _BIG)),
    "small": _both(0.5, 0.3, 0.4, 0.8, (_BEFORE_SMALL, _SMALL)),
}
"""Scripts by name; gestures of one hand that names no hand are made with the right one.

Those whose names differ by a number at the end mean the same, and one is chosen at random."""
