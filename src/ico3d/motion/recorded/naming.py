"""Names of gestures by what hands do at the moment of the stroke."""

import numpy as np

from ico3d.motion.recorded.recording import Hand, Recording

RAISE = "raise"
"""A hand above the head: a name of which the package has no gesture."""
NEAR_CHIN, NEAR_HEART = 0.3, 0.3
"""Arm lengths from fingertips to chin, and from knuckles to breastbone."""
STRAIGHT, BENT = 50.0, 85.0
"""Degrees that a straight finger is bent at most, and a bent one at least."""
POINTED, STRETCHED = 0.75, 0.92
"""Arm lengths from shoulder to wrist of who points with the index alone, or with the hand."""
NOT_DOWN = -0.5
"""Arm lengths that a pointing wrist is above the shoulder at least."""
ABOVE = 0.45
"""Arm lengths above the shoulder from which a hand is raised."""
FACING = 0.6
"""How much a palm looks up, to the other hand or at the body: the coordinate of its direction."""
INWARDS = 0.8
"""The same of palms that look at each other."""
UPWARDS = 0.6
"""The same of fingers that count."""
AHEAD = 0.3
"""Arm lengths that an offering hand is before the shoulder at least."""
SHRUGGED = 8.0
"""Degrees by which collarbones are lifted more than at rest."""
WIDE = 0.4
"""Arm lengths outside of the shoulder of hands that welcome or show a size."""
CLOSE = -0.02
"""The same of hands between which something small is, at most."""
LOW = -0.4
"""Arm lengths above the shoulder of hands that welcome, at least."""


def name_of(recording: Recording, hands: tuple[str, ...], frame: int, rest: int) -> str:
    """What a gesture with one stroke is called.

    Args:
        recording: Of whom.
        hands: Which take part: one, or both.
        frame: Where the stroke arrives.
        rest: A frame of rest, that tells how collarbones lie.
    """
    made = {side: recording.hands[side] for side in hands}
    if len(made) == 2:
        lifts = [hand.lifted[frame] - hand.lifted[rest] for hand in made.values()]
        return _of_both(list(made.values()), frame, min(lifts))
    ((side, hand),) = made.items()
    return _of_one(hand, frame) or f"beat_{side}"


def _of_one(hand: Hand, i: int) -> str | None:
    """The name of what one hand does; None for a beat."""
    _, up, ahead = hand.place[i]
    if hand.to_chin[i] < NEAR_CHIN:
        return "think"
    if hand.to_heart[i] < NEAR_HEART and hand.palm[i, 2] < -FACING:
        return "hand_on_heart"
    if up > ABOVE:
        return RAISE
    straight, bent = hand.bends[i] < STRAIGHT, hand.bends[i] > BENT
    index_alone = len(straight) > 0 and straight[0] and bent[1:].sum() >= 2
    if hand.reach[i] > (POINTED if index_alone else STRETCHED) and up > NOT_DOWN:
        return "point"
    if hand.fingers[i, 1] > UPWARDS and index_alone | _counts(straight, bent):
        return f"count_{('one', 'two', 'three')[int(straight.sum()) - 1]}"
    if hand.palm[i, 1] > FACING and ahead > AHEAD:
        return "open_hand"
    return None


def _counts(straight: np.ndarray, bent: np.ndarray) -> bool:
    """Whether one to three fingers are straight, the index first, and all others bent."""
    count = int(straight.sum())
    return bool(1 <= count <= 3 and straight[:count].all() and bent[count:].all())


def _of_both(hands: list[Hand], i: int, lifted: float) -> str:
    """The name of what both hands do, with collarbones lifted by so many degrees."""
    places = np.stack([hand.place[i] for hand in hands])  # (2, 3) outwards, upwards, ahead
    palms = np.stack([hand.palm[i] for hand in hands])
    out, up, ahead = places.min(0)
    if up > ABOVE:
        return RAISE
    if lifted > SHRUGGED and up < 0:
        return "shrug"
    if (palms[:, 0] < -INWARDS).all() and ahead > AHEAD:
        if out > WIDE:
            return "big"
        if places[:, 0].max() < CLOSE:
            return "small"
    if out > WIDE and up > LOW:
        return "welcome"
    if (palms[:, 1] > FACING).all() and ahead > AHEAD:
        return "open_hands"
    return "beat_both"
