"""A walk through what a person does in conversations, for recording a body that is to gesture.

Everything has its share of the time, whatever the number of frames: hands go to all places in turn,
near and far, open and closed, while head and chest turn; at last the person walks in place.
"""

import numpy as np

from ico3d.studio.acting.hands import DOWN, PLACES, RAISED, READY, Hand, Track, minimum_jerk

WAVING = Hand((0.17, 0.14, 0.30), (0.6, -0.8, -0.1), palm=25.0, flexed=-8.0, curled=4.0)
THINKING = Hand((-0.07, 0.02, 0.19), (0.5, -1.0, 0.1), palm=20.0, flexed=20.0, curled=38.0)
ASIDE = Hand((0.42, -0.12, 0.12), (0.4, -0.7, -0.6), palm=-40.0, curled=8.0)
OFFERING = Hand((0.22, -0.22, 0.34), (0.3, -0.85, -0.45), palm=-95.0, flexed=-12.0, curled=6.0)
POINTING = Hand((-0.02, -0.06, 0.46), (0.5, -0.8, -0.3), palm=-15.0, curled=30.0)
COUNTING = Hand((0.06, 0.02, 0.30), (0.45, -0.88, -0.1), palm=40.0, curled=50.0)
ON_HEART = Hand((-0.15, -0.10, 0.15), (0.8, -0.6, 0.1), palm=10.0, flexed=6.0, curled=10.0)
ON_HIP = Hand((0.10, -0.36, 0.05), (1.0, -0.1, -0.5), palm=-10.0, flexed=20.0, curled=30.0)
FIST = Hand((0.04, -0.16, 0.34), (0.6, -0.85, -0.2), palm=-10.0, curled=62.0)

PAIRS = (
    (PLACES[0], PLACES[1]),
    (WAVING, DOWN),
    (OFFERING, OFFERING),
    (PLACES[2], THINKING),
    (DOWN, WAVING),
    (ASIDE, ASIDE),
    (POINTING, PLACES[3]),
    (ON_HEART, DOWN),
    (COUNTING, FIST),
    (THINKING, ON_HIP),
    (PLACES[4], POINTING),
    (RAISED[0], READY),
    (FIST, COUNTING),
    (ON_HIP, ON_HEART),
    (READY, RAISED[1]),
)
"""Where the left and the right hand go in turn."""
STILL = 0.04
"""Share of the time at the beginning in which the arms hang down."""
HANDS_DONE = 0.84
"""Share of the time after which the arms hang down again and the person walks."""
ON_THE_WAY = 0.6
"""Share of the time of each pose in which the hands go there; then they rest."""
HEAD = np.radians(
    [
        (0, 0, 0),
        (0, 32, 0),
        (-10, 20, 5),
        (6, -18, -4),
        (0, -34, 0),
        (14, 0, 0),
        (-14, 6, 0),
        (4, 0, 13),
        (4, 0, -13),
        (8, 26, 6),
        (-6, -26, -6),
    ]
)
"""(K, 3) turns of the head about X, Y, Z that follow one another, radians."""
HEAD_TURNS = 22
"""Number of turns of the head in the whole time."""
CHEST = np.radians([(0, 0, 0), (0, 18, 0), (5, 0, 0), (0, -18, 0), (0, 8, 5), (-2, -8, -5)])
"""(K, 3) turns of the chest about X, Y, Z that follow one another, radians."""
CHEST_TURNS = 12
"""Number of turns of the chest in the whole time."""


def repertoire(end: float, random: np.random.Generator) -> tuple[Track, Track]:
    """The hands' paths, left and right, until `end` seconds."""
    begin, done = STILL * end, HANDS_DONE * end
    each = (done - begin) / (len(PAIRS) + 1)
    tracks = (Track(), Track())
    for side, track in enumerate(tracks):
        track.hold(begin)
        for pair in (*PAIRS, (DOWN, DOWN)):
            track.go(pair[side], ON_THE_WAY * each, random.uniform(-0.012, 0.012, 3))
            track.hold(track.now + (1 - ON_THE_WAY) * each)
        track.hold(end)
    return tracks


def looking_about(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turns (F, 3) of head and chest about X, Y, Z at `times` in seconds, radians."""
    return _turning(HEAD, HEAD_TURNS, times), _turning(CHEST, CHEST_TURNS, times)


def _turning(turns: np.ndarray, count: int, times: np.ndarray) -> np.ndarray:
    """(F, 3) of `count` of the turns (K, 3), which follow one another evenly until the end."""
    keys = np.linspace(0, max(float(times[-1]), 1e-9), count + 1)
    return minimum_jerk(keys, turns[np.arange(count + 1) % len(turns)], times)
