"""Finds gestures in a recording: spans of frames, with names."""

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
"""Arm lengths from where a hand rests from which it gestures, and at which it is back."""
LEAST, GAP = 0.3, 0.2
"""Seconds that a gesture lasts at least, and that two of them are apart."""
CALM = 0.3
"""Arm lengths a second below which a hand is calm."""
HANGS = -0.55
"""Arm lengths above the shoulder below which a wrist may rest."""
LEAST_REST = 0.5
"""Seconds that somebody rests at least."""
SLOWER = 1.8
"""How many times slower than before and after a hand is where a stroke arrives."""
HELD = 1.7
"""How many times faster than where it is slowest a hand may be that is held."""
ARRIVED = 0.1
"""Part of its fastest to which a hand has slowed down where the stroke arrives."""
JITTER = 2.0, (0.1, 0.3)
"""How many times faster than a resting hand, whose pose jitters, and between which arm lengths a
second, a hand may be that is held."""
PREPARED, SOON = 0.22, 0.8
"""Seconds: the hand that stops for less than the first, and is elsewhere within the second, was
brought to where the stroke begins."""
TAKES_PART = 0.35
"""How far a hand goes in a gesture that is its own, next to the other one, at least."""
SWING = 0.15
"""Arm lengths that the tip of a waving hand goes to a side, at least."""
SWINGS = 3
"""How often a waving hand goes from side to side, at least."""
AFTERWARDS = 0.35
"""Seconds after a wave in which a stop is its end."""
UPRIGHT, SHOULDER = 0.3, -0.25
"""How much a waving hand points up, and arm lengths that it is above the shoulder, at least."""
ALIKE = 4
"""Cuts of one name that are kept, at most: those that go farthest."""


@dataclass(frozen=True, eq=False)
class _Watched:
    """What is told of the hands before anything is cut.

    Attributes:
        recording: Whose.
        rest: First and last frame of the longest rest; None where nobody rests.
        away: (2, F) arm lengths of the left and the right hand from where they rest.
        speed: (2, F) arm lengths a second.
        jitter: Arm lengths a second up to which a hand that is held seems to move.
    """

    recording: Recording
    rest: tuple[int, int] | None
    away: Array
    speed: Array
    jitter: float

    @property
    def resting(self) -> int:
        """A frame of rest; where there is none, that with the hands the nearest to hanging."""
        if self.rest is not None:
            return sum(self.rest) // 2
        return int(self.away.max(0).argmin())


def find_cuts(recording: Recording) -> list[Cut]:
    """What somebody did, by rule, in the order of time.

    Gestures of the hands last from when they leave their rest until they are back; there each place
    at which they slow down is a stroke of its own, and a hand that goes from side to side waves.
    Names follow from what hands do where the stroke arrives; nods and shakes are the head's.
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
    long = [run for run in runs(calm) if run[1] - run[0] + 1 >= recording.frames(LEAST_REST)]
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
    """First and last frame of what hands do between one rest and the next."""
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
    """The gestures of a span, each from where the one before is let go."""
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
    """Strokes: where the hands slow down, each from where the one before ends."""
    away = np.any(seen.away > AWAY, axis=0)  # (F,)
    speed = np.where(seen.away > BACK, seen.speed, 0).max(0)  # (F,) of what gestures
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
    """A stroke that begins where the hands were before."""
    sides = _taking_part(seen, first, stroke)
    name = name_of(seen.recording, sides, stroke, seen.resting)
    hands: Hands = "both" if len(sides) == 2 else sides[0]
    return Cut(name, hands, first, stroke, release, release)


def _prepares(stops: list[tuple[int, int]], fps: float) -> bool:
    """Whether the first stop only brings the hands to where the stroke begins."""
    if len(stops) < 2:
        return False
    (begin, end), (after, _) = stops[:2]
    return end - begin < PREPARED * fps and after - end <= SOON * fps


def _run(there: np.ndarray) -> int:
    """How many are True before the first that is not."""
    return int(np.argmin(np.append(there, False)))


def _others(turns: list[int]) -> list[int]:
    """For each turning point one beside it."""
    return [turns[i - 1] if i else turns[1] for i in range(len(turns))]


def _taking_part(seen: _Watched, first: int, stroke: int) -> tuple[Side, ...]:
    """The hands that are away from rest and go about as far; of none, the one farther away."""
    hands = [seen.recording.hands[side].knuckles[first : stroke + 1] for side in SIDES]
    gone = [np.ptp(knuckles, axis=0).max() for knuckles in hands]
    found: list[Side] = [
        side
        for side, away, far in zip(SIDES, seen.away[:, stroke], gone, strict=True)
        if away > AWAY and far > TAKES_PART * max(gone)
    ]
    return tuple(found) or (SIDES[int(seen.away[:, stroke].argmax())],)


def _waves(seen: _Watched, side: Side, first: int, last: int) -> list[Cut]:
    """Where a hand that points up goes from side to side; from its first turn to its last."""
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
            back = turns[::2][-1]  # on the side of the stroke again
            found.append(Cut("wave", side, begin + volley[0].begin, turns[0], back, turns[-1]))
    return found


def _rank(seen: _Watched, cut: Cut, found: list[Cut]) -> int:
    """How many cuts of the same name go farther."""

    def size(one: Cut) -> float:
        return float(seen.away[:, one.stroke].max())

    return sum(size(one) > size(cut) for one in found if one.name == cut.name)
