"""Names recorded gestures by the hands at the moment when the stroke arrives.

Lengths are in arm lengths, from shoulder to wrist; directions are unit vectors.
"""

import numpy as np

from ico3d.motion.recorded.recording import Hand, Recording

RAISE = "raise"
"""Name of gestures with a hand above the head; the package has no gesture of this name."""
NEAR_CHIN, NEAR_HEART = 0.3, 0.3
"""Largest distances from fingertips to chin (think), and from knuckles to breastbone (heart)."""
STRAIGHT, BENT = 50.0, 85.0
"""Largest angle in degrees of a straight finger, and least angle of a bent one."""
POINTED, STRETCHED = 0.75, 0.92
"""Least distance from shoulder to wrist when pointing with the index alone, or with the hand."""
NOT_DOWN = -0.5
"""Least height of a pointing wrist above the shoulder."""
ABOVE = 0.45
"""Height above the shoulder from which a hand is raised."""
FACING = 0.6
"""Least upward (or backward, at the body) component of a palm's direction to count as such."""
INWARDS = 0.8
"""Least inward component of the directions of palms that face each other."""
UPWARDS = 0.6
"""Least upward component of the direction of counting fingers."""
AHEAD = 0.3
"""Least distance of an offering hand in front of the shoulder."""
SHRUGGED = 8.0
"""Degrees by which collarbones are lifted in a shrug, more than at rest."""
WIDE = 0.4
"""Least distance outside of the shoulders of hands that welcome or show something big."""
CLOSE = -0.02
"""Largest distance outside of the shoulders of hands that show something small."""
LOW = -0.4
"""Least height above the shoulders of hands that welcome."""


def name_of(recording: Recording, hands: tuple[str, ...], frame: int, rest: int) -> str:
    """Name of a recorded gesture with one stroke.

    Args:
        recording: The recording.
        hands: Sides of the hands that take part: one or both.
        frame: Frame in which the stroke arrives.
        rest: A frame of rest, for the angle of resting collarbones.
    """
    made = {side: recording.hands[side] for side in hands}
    if len(made) == 2:
        lifts = [hand.lifted[frame] - hand.lifted[rest] for hand in made.values()]
        return _of_both(list(made.values()), frame, min(lifts))
    ((side, hand),) = made.items()
    return _of_one(hand, frame) or f"beat_{side}"


def _of_one(hand: Hand, i: int) -> str | None:
    """Name of a gesture of one hand at frame `i`; None for a beat."""
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
    """Whether one to three fingers, from the index on, are straight and all others bent."""
    count = int(straight.sum())
    return bool(1 <= count <= 3 and straight[:count].all() and bent[count:].all())


def _of_both(hands: list[Hand], i: int, lifted: float) -> str:
    """Name of a gesture of both hands at frame `i`, with collarbones lifted by `lifted` degrees."""
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
