"""Movements of a synthetic body: standing, gesturing, fast movements, swaying, walking in place."""

from dataclasses import replace

import numpy as np

from ico3d.studio.acting.acting import Acting
from ico3d.studio.acting.hands import DOWN, PLACES, RAISED, READY, Track, minimum_jerk
from ico3d.studio.acting.limbs import Limb
from ico3d.studio.acting.performance import wander
from ico3d.studio.acting.repertoire import HANDS_DONE, looking_about, repertoire
from ico3d.studio.person.skeleton import Skeleton

MOTIONS = ("showcase", "talk", "walk", "sway", "repertoire")
ARM = 0.517
"""Length in metres, shoulder to wrist, of the arm for which lengths in this module are written.

The lengths are scaled for other people.
"""
STANCE = 0.13
"""Distance of an ankle from the body's middle, metres."""
SOFT_KNEES = 0.006
"""Metres by which the pelvis is lowered from the rest pose, so that sway overstretches no leg."""
TOES_OUT = np.radians(9.0)
FAST = 0.4
"""Seconds in which a hand is raised above the head."""
GESTURE = (0.3, 0.6)
"""Range of the random duration in seconds of a hand's movement; `PACE` may prolong it."""
PACE = 0.8
"""Highest mean speed of a gesturing wrist over a movement, metres per second."""
HIP_TURNS = ((np.radians(13.0), 0.45), (np.radians(26.0), FAST))
"""Turns of swaying hips: largest angle in radians, and seconds from one side to the other.

The first pair is for calm, the second for quick sway.
"""
COUNTER = 0.75
"""Share of a turn of the hips that the chest turns back."""
BENT_KNEES = 0.03
"""Metres by which the pelvis is lowered so that feet can stay in place while the hips turn."""
ASIDE = 0.05
"""Sideways displacement of the pelvis per turn of the hips, metres per radian."""
CLEAR = (-0.46, -0.28, 0.17)
"""How hands keep off a skirt: two heights, and a distance outwards, metres from the shoulder.

Wrists below the second height are moved outwards, more and more down to the first height, from
which on the distance is the full one.
"""
STEPS = 1.7
"""Steps per second."""
STEP_HEIGHT = 0.13


def act(
    skeleton: Skeleton, motion: str, times: np.ndarray, seed: int, clear: bool = False
) -> Acting:
    """The movements of a body at given times.

    Args:
        skeleton: Skeleton of the person.
        motion: One of `MOTIONS`. `showcase`: stands calmly, gestures, moves fast, a third of the
            time each. `sway`: the same, but also turns the hips, first slowly, then fast. `talk`:
            stands and gestures in turn. `walk`: walks in place. `repertoire`: hands, head and chest
            go through what they do in conversations, then the person walks in place.
        times: (F,) seconds, ascending from 0.
        seed: Seed of all random choices.
        clear: Whether hands keep away from hips and thighs.
    """
    random = np.random.default_rng([seed, 3])
    end = float(times[-1])
    makers = {
        "showcase": _showcase,
        "sway": _showcase,
        "talk": _talk,
        "walk": _stand,
        "repertoire": repertoire,
    }
    tracks = makers[motion](end, random)
    hands = np.stack([track.at(times) for track in tracks])  # (2, F, 9)
    hands[:, :, :3] += 0.006 * np.stack(
        [np.stack([wander(times, 0.6, random) for _ in range(3)], 1) for _ in range(2)]
    )
    if clear:
        hands[:, :, :3] = _cleared(hands[:, :, :3])
    hands[:, :, :3] *= _size(skeleton)
    begin = {"walk": 0.0, "repertoire": HANDS_DONE * end}.get(motion, end)
    stride = _stride(times, begin, end)
    acting = _whole_body(skeleton, times, hands, stride, random)
    if motion == "repertoire":
        head, chest = looking_about(times)
        return replace(acting, head=acting.head + head, chest=acting.chest + chest)
    return _swaying(acting, times, end) if motion == "sway" else acting


def _cleared(wrists: np.ndarray) -> np.ndarray:
    """Wrists (2, F, 3) further out the lower they hang, as far from the shoulder as before."""
    low, high, out = CLEAR
    part = np.clip((high - wrists[..., 1]) / (high - low), 0, 1)
    moved = wrists.copy()
    moved[..., 0] += out * part * part * (3 - 2 * part)
    before, after = (np.linalg.norm(w, axis=-1, keepdims=True) for w in (wrists, moved))
    return moved * np.minimum(1.0, before / after)


def _swaying(acting: Acting, times: np.ndarray, end: float) -> Acting:
    """Adds hips that turn under the shoulders: calmly in the second third, fast in the last."""
    keys, turns = [0.0, end / 3], [0.0, 0.0]
    for angle, seconds in HIP_TURNS:
        ways = max(1, round(end / 3 / seconds))
        keys += [keys[-1] + end / 3 * (way + 1) / ways for way in range(ways)]
        turns += [angle * (-1) ** (len(turns) + way) for way in range(ways)]
    turn = minimum_jerk(np.array(keys), np.array(turns)[:, None], times)[:, 0]  # (F,)
    zero = np.zeros_like(turn)
    yaw = np.stack([zero, turn, zero], 1)
    shift = np.stack([ASIDE * turn, np.full_like(turn, -BENT_KNEES), zero], 1)
    return replace(
        acting,
        shift=acting.shift + shift,
        pelvis=acting.pelvis + yaw,
        chest=acting.chest - COUNTER * yaw,
    )


def _size(skeleton: Skeleton) -> float:
    """How long this person's arms are, next to `ARM`."""
    return sum(Limb.of(skeleton, "upperarm01.L", "lowerarm01.L", "wrist.L").lengths) / ARM


def _showcase(end: float, random: np.random.Generator) -> tuple[Track, Track]:
    """Calm, gesture, fast: a third each."""
    tracks = (Track(), Track())
    lead = int(random.integers(2))
    for index, track in enumerate(tracks):
        track.hold(end / 3 + (0.0 if index == lead else 0.08))
        _gesture(track, 2 * end / 3, random)
    _go_ready(tracks[lead], 2 * end / 3)
    _fast(tracks[lead], tracks[1 - lead], end, random)
    return tracks


def _gesture(track: Track, until: float, random: np.random.Generator) -> None:
    """Places for a hand, one after the other, as many as there is time for."""
    places = [PLACES[i] for i in random.permutation(len(PLACES))]
    while until - track.now > GESTURE[0]:
        left = until - track.now
        least = float(np.linalg.norm(places[0].row()[:3] - track.rows[-1][:3])) / PACE
        seconds = max(float(random.uniform(*GESTURE)), least)
        if left - seconds < GESTURE[0]:
            seconds = left
        track.go(places[0], seconds, random.uniform(-0.02, 0.02, 3))
        places = places[1:] + places[:1]


def _go_ready(track: Track, at: float) -> None:
    """The last key of a track becomes the place from which the hand rises."""
    track.times[-1], track.rows[-1] = at, READY.row()


def _fast(lead: Track, other: Track, end: float, random: np.random.Generator) -> None:
    """One hand goes above the head and back, again and again, while the other follows calmly."""
    spare = 0.1
    while end - lead.now >= 2 * FAST:
        lead.go(RAISED[int(random.integers(len(RAISED)))], FAST, random.uniform(-0.02, 0.02, 3))
        lead.hold(lead.now + min(spare, max(0.0, end - lead.now - FAST)))
        lead.go(READY, FAST)
        lead.hold(lead.now + float(random.uniform(0.2, 0.6)))
    _gesture(other, end, random)


def _talk(end: float, random: np.random.Generator) -> tuple[Track, Track]:
    """Stands calmly and gestures in turn."""
    tracks = (Track(), Track())
    now = 0.0
    while now < end:
        now += float(random.uniform(1.0, 2.5))
        both = random.random() < 0.6
        lead = int(random.integers(2))
        until = now + float(random.uniform(2.0, 4.0))
        for index in (0, 1) if both else (lead,):
            tracks[index].hold(now + 0.1 * (index != lead))
            _gesture(tracks[index], until, random)
            tracks[index].go(DOWN, float(random.uniform(0.7, 1.0)))
        now = max(track.now for track in tracks)
    return tracks


def _stand(end: float, random: np.random.Generator) -> tuple[Track, Track]:
    """Arms hang down."""
    tracks = (Track(), Track())
    for track in tracks:
        track.hold(end)
    return tracks


def _stride(times: np.ndarray, begin: float, end: float) -> np.ndarray:
    """(2, F) how high each foot is, 0 to 1: steps start 0.3 s after `begin`, end before `end`."""
    cycles = 0.5 * STEPS * (times - begin - 0.3)
    last = np.floor(0.5 * STEPS * (end - begin - 0.3) * 2) / 2
    feet = []
    for offset in (0.0, 0.5):
        phase = cycles - offset
        lifted = (phase > 0) & (phase % 1.0 < 0.5) & (np.floor(phase) + 0.5 <= last - offset)
        feet.append(np.where(lifted, np.sin(2 * np.pi * (phase % 1.0)) ** 2, 0.0))
    return np.stack(feet)


def _whole_body(
    skeleton: Skeleton,
    times: np.ndarray,
    hands: np.ndarray,
    stride: np.ndarray,
    random: np.random.Generator,
) -> Acting:
    """Adds breath, weight shift and what the torso does with the hands."""
    breath = np.sin(2 * np.pi * (0.28 * times + random.random()))
    weight = wander(times, 0.35, random)  # (F,) -1: on the right foot
    step = stride[0] - stride[1]
    ahead = hands[0, :, 2] - hands[1, :, 2]
    above = hands[0, :, 1] - hands[1, :, 1]
    hands = hands.copy()
    hands[:, :, 1] += 0.004 * breath
    hands[0, :, 2] -= 0.16 * step
    hands[1, :, 2] += 0.16 * step
    turns = [wander(times, f, random) for f in (0.3, 0.3, 0.25, 0.5, 0.6, 0.5)]
    zero = np.zeros_like(times)
    shift = np.stack(
        [
            0.022 * weight - 0.035 * step,
            0.002 * breath - 0.012 * np.abs(step) - SOFT_KNEES,
            0.01 * turns[0],
        ],
        1,
    )
    pelvis = np.stack(
        [zero, 0.05 * turns[1] - 0.06 * step, 0.025 * weight - 0.03 * step], 1
    )  # (F, 3)
    chest = np.stack(
        [
            0.014 * breath - 0.05 * np.clip(hands[:, :, 1].max(0), 0, None),
            0.05 * turns[2] - 0.25 * ahead + 0.10 * step,
            -0.03 * weight + 0.03 * step + 0.06 * above,
        ],
        1,
    )
    head = np.stack(
        [0.09 * turns[3], 0.22 * turns[4] + 0.12 * ahead, 0.06 * turns[5] - 0.03 * above], 1
    )
    side = np.array([1.0, -1.0])
    mirror = np.stack([side, np.ones(2), np.ones(2)], 1)[:, None]  # (2, 1, 3)
    return Acting(
        shift=shift,
        pelvis=pelvis,
        chest=chest,
        head=head,
        wrists=hands[:, :, :3] * mirror,
        elbows=hands[:, :, 3:6] * mirror,
        palms=hands[:, :, 6],
        flexed=hands[:, :, 7],
        curled=hands[:, :, 8],
        ankles=_ankles(skeleton, stride),
        tiptoe=0.45 * stride,
        toes_out=np.full(2, TOES_OUT),
    )


def _ankles(skeleton: Skeleton, stride: np.ndarray) -> np.ndarray:
    """(2, F, 3): on the floor, or lifted."""
    rest = skeleton.at[[skeleton.index("foot.L"), skeleton.index("foot.R")]]  # (2, 3)
    ankles = np.tile(rest[:, None], (1, stride.shape[1], 1))
    ankles[:, :, 0] = _size(skeleton) * np.array([[STANCE], [-STANCE]])
    ankles[:, :, 1] += STEP_HEIGHT * stride
    ankles[:, :, 2] -= 0.05 * stride
    return ankles
