"""Finds gestures in a recording by rule: their frames and names.

Lengths are in arm lengths, from shoulder to wrist; frames count from 0.
"""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.motion.recorded.cut import REST, Cut, Hands
from ico3d.motion.recorded.head_cuts import head_cuts
from ico3d.motion.recorded.naming import name_of
from ico3d.motion.recorded.recording import Recording
from ico3d.motion.recorded.turning_points import runs, swings, turning_points, volleys
from ico3d.motion.roles import SIDES, Side
from ico3d.rig.quaternions import Array

AWAY, BACK = 0.22, 0.04
"""Distances of a hand from its rest above which it gestures, and up to which it is back."""
LEAST, GAP = 0.3, 0.2
"""Least duration of a gesture, and of a rest between two gestures, seconds."""
CALM = 0.3
"""Speed per second below which a hand is calm."""
HANGS = -0.55
"""Height of a wrist relative to the shoulder below which it may be at rest."""
LEAST_REST = 0.5
"""Least duration of a rest, seconds."""
SLOWER = 1.8
"""Factor by which a hand must be slower where a stroke arrives than before and after."""
HELD = 1.7
"""A hand counts as held up to this multiple of its lowest speed."""
ARRIVED = 0.1
"""A stroke arrives where the hand has slowed down to this share of its highest speed."""
JITTER = 2.0, (0.1, 0.3)
"""A hand counts as held up to this multiple of a resting hand's apparent speed.

A resting hand seems to move, as tracked poses jitter. The product is clamped to the given range.
"""
PREPARED, SOON = 0.22, 0.8
"""A first stop is a preparation if it is shorter than the first of these times in seconds, and if
the next stop follows within the second."""
TAKES_PART = 0.35
"""Least distance that a hand moves in a gesture, relative to the other hand, to take part in it."""
SWING = 0.15
"""Least distance to a side that the tip of a waving hand moves."""
SWINGS = 3
"""Least number of swings from side to side in a wave."""
AFTERWARDS = 0.35
"""Seconds after a wave in which a stop still belongs to the wave."""
UPRIGHT, SHOULDER = 0.3, -0.25
"""Least upward component of a waving hand's direction, and least height above the shoulder."""
ALIKE = 4
"""Most cuts of one name that are kept: those in which hands are farthest from rest."""


@dataclass(frozen=True, eq=False)
class _Watched:
    """Measurements of the hands in a recording of F frames; rows are the left and the right hand.

    Attributes:
        recording: The recording.
        rest: First and last frame of the longest rest; None where there is no rest.
        away: (2, F) distance of each hand from its rest, arm lengths.
        speed: (2, F) speed of each hand, arm lengths per second.
        jitter: Speed up to which a hand counts as held, arm lengths per second.
    """

    recording: Recording
    rest: tuple[int, int] | None
    away: Array
    speed: Array
    jitter: float

    @property
    def resting(self) -> int:
        """A frame of rest; without a rest, the frame in which hands are nearest to hanging."""
        if self.rest is not None:
            return sum(self.rest) // 2
        return int(self.away.max(0).argmin())


def find_cuts(recording: Recording) -> list[Cut]:
    """Finds the gestures in a recording by rule, in order of time.

    The time from when the hands leave their rest until they are back is cut into gestures: each
    slowing down is the end of a stroke, and a hand that swings from side to side waves. Names
    follow from the hands where the stroke arrives (`naming.name_of`). Nods and shakes of the head
    are found as well, and the longest rest is a cut of its own.
    """
    seen = _watched(recording)
    found = [cut for span in _spans(seen) for cut in _of_span(seen, *span)]
    found += head_cuts(recording)
    kept = [cut for cut in found if _rank(seen, cut, found) < ALIKE]
    if seen.rest is not None:
        first, last = seen.rest
        kept.append(Cut(REST, "both", first, first, last, last))
    return sorted(kept, key=lambda cut: (cut.first, cut.last, cut.name))


def _watched(recording: Recording) -> _Watched:
    hands = [recording.hands[side] for side in SIDES]
    speed = np.stack([recording.speed(side) for side in SIDES])  # (2, F)
    low = np.all([hand.place[:, 1] < HANGS for hand in hands], axis=0)
    calm = (speed < CALM).all(0) & low  # (F,)
    least = max(recording.frames(LEAST_REST), 2)  # a cut has two frames or more
    long = [run for run in runs(calm) if run[1] - run[0] + 1 >= least]
    rest = max(long, key=lambda run: run[1] - run[0], default=None)
    away: list[Array] = []
    for side, hand in zip(SIDES, hands, strict=True):
        at_rest = recording.hanging[side].knuckles[0]
        if calm.any():
            at_rest = np.median(hand.knuckles[calm], axis=0)
        away.append(np.linalg.norm(hand.knuckles - at_rest, axis=-1))
    times, (least, most) = JITTER
    jitter = times * float(np.median(speed[:, calm])) if calm.any() else most
    return _Watched(recording, rest, np.stack(away), speed, min(max(jitter, least), most))


def _spans(seen: _Watched) -> list[tuple[int, int]]:
    """First and last frame of each span in which the hands are away from their rest."""
    frames = seen.recording.frames
    active = np.any(seen.away > AWAY, axis=0)  # (F,)
    for first, last in runs(~active):
        if last - first + 1 < frames(GAP) and first > 0 and last < len(active) - 1:
            active[first : last + 1] = True
    whole = [run for run in runs(active) if run[1] - run[0] + 1 >= frames(LEAST)]
    away = seen.away.max(0)
    found: list[tuple[int, int]] = []
    for first, last in whole:
        while first > 0 and away[first] > BACK and away[first - 1] < away[first]:
            first -= 1
        while last < len(away) - 1 and away[last] > BACK and away[last + 1] < away[last]:
            last += 1
        found.append((first, last))
    return found


def _of_span(seen: _Watched, first: int, last: int) -> list[Cut]:
    """The gestures of hands in a span; each begins where the one before is released."""
    waves = [wave for side in SIDES for wave in _waves(seen, side, first, last)]
    after = seen.recording.frames(AFTERWARDS)
    strokes = [
        stop
        for stop in _stops(seen, first, last)
        if not any(stop.stroke <= wave.last + after and stop.last >= wave.first for wave in waves)
    ]
    found: list[Cut] = []
    for cut in sorted(waves + strokes, key=lambda cut: cut.stroke):
        begin = found[-1].release if found else first
        found.append(replace(cut, first=begin, last=cut.release))
    return [*found[:-1], *(replace(cut, last=last) for cut in found[-1:])]


def _stops(seen: _Watched, first: int, last: int) -> list[Cut]:
    """A cut for each stroke of a span, which arrives where the hands slow down."""
    away = np.any(seen.away > AWAY, axis=0)  # (F,)
    speed = np.where(seen.away > BACK, seen.speed, 0).max(0)  # (F,) of hands away from rest
    part = np.log(speed[first : last + 1] + 0.1 * CALM)
    turns = turning_points(part, np.log(SLOWER))
    lows = [first + i for i, j in zip(turns, _others(turns), strict=True) if part[i] < part[j]]
    found: list[tuple[int, int]] = []
    for low in lows:
        before = found[-1][1] if found else first
        if away[low] and before < low < last:
            still = max(seen.jitter, HELD * speed[low])
            arrived = max(still, ARRIVED * speed[before:low].max())
            begin = low - _run(speed[before + 1 : low + 1][::-1] <= arrived) + 1
            end = low + _run(speed[low : last + 1] <= still) - 1
            found.append((begin, end))
    before = [first, *(end for _, end in found)]
    cuts = [_stroke(seen, a, *stop) for a, stop in zip(before, found, strict=False)]
    return cuts[1:] if _prepares(found, seen.recording.fps) else cuts


def _stroke(seen: _Watched, first: int, stroke: int, release: int) -> Cut:
    """A cut with one stroke, with its name, from frame `first` to frame `release`."""
    sides = _taking_part(seen, first, stroke)
    name = name_of(seen.recording, sides, stroke, seen.resting)
    hands: Hands = "both" if len(sides) == 2 else sides[0]
    return Cut(name, hands, first, stroke, release, release)


def _prepares(stops: list[tuple[int, int]], fps: float) -> bool:
    """Whether the first stop is only a preparation of the next stroke.

    Args:
        stops: First and last frame of each stop.
        fps: Frames per second.
    """
    if len(stops) < 2:
        return False
    (begin, end), (after, _) = stops[:2]
    return end - begin < PREPARED * fps and after - end <= SOON * fps


def _run(there: np.ndarray) -> int:
    """Number of leading True values."""
    return int(np.argmin(np.append(there, False)))


def _others(turns: list[int]) -> list[int]:
    """For each turning point a neighbouring one: the one before it, for the first the second."""
    return [turns[i - 1] if i else turns[1] for i in range(len(turns))]


def _taking_part(seen: _Watched, first: int, stroke: int) -> tuple[Side, ...]:
    """Sides of the hands that take part in a stroke: those away from rest that move far enough.

    If none does, it is the hand that is farther from rest.
    """
    hands = [seen.recording.hands[side].knuckles[first : stroke + 1] for side in SIDES]
    gone = [np.ptp(knuckles, axis=0).max() for knuckles in hands]
    found: list[Side] = [
        side
        for side, away, far in zip(SIDES, seen.away[:, stroke], gone, strict=True)
        if away > AWAY and far > TAKES_PART * max(gone)
    ]
    return tuple(found) or (SIDES[int(seen.away[:, stroke].argmax())],)


def _waves(seen: _Watched, side: Side, first: int, last: int) -> list[Cut]:
    """Waves of a hand in a span: it points up and swings from side to side."""
    recording, hand = seen.recording, seen.recording.hands[side]
    up = (hand.fingers[:, 1] > UPRIGHT) & (hand.place[:, 1] > SHOULDER)
    found: list[Cut] = []
    for begin, end in runs(up[first : last + 1]):
        begin, end = first + begin, first + end
        whole = swings(hand.tip[begin : end + 1, 0], SWING)
        for volley in volleys(whole, recording):
            if len(volley) < SWINGS:
                continue
            turns = [begin + swing.end for swing in volley]
            back = turns[::2][-1]  # the last turn on the same side as the stroke
            found.append(Cut("wave", side, begin + volley[0].begin, turns[0], back, turns[-1]))
    return found


def _rank(seen: _Watched, cut: Cut, found: list[Cut]) -> int:
    """Number of cuts of the same name in which hands are farther from rest at the stroke."""

    def size(one: Cut) -> float:
        return float(seen.away[:, one.stroke].max())

    return sum(size(one) > size(cut) for one in found if one.name == cut.name)
