"""Chooses gestures for what is said, and puts their strokes on its accents.

For a speech that still grows: what was handed out stays as it was. Every stroke that begins arrives
and stays for a moment; a gesture is held until the phrase ends or the next one takes the hands.
"""

import numpy as np

from ico3d.motion.clip import Clip, meaning
from ico3d.motion.composing.accents import FRAME, SPOKEN, Accent, Word, accents
from ico3d.motion.composing.cues import (
    BLEND_IN,
    SETTLE,
    TAKE_UP,
    Cue,
    Direction,
    Release,
    end_of,
    rounded_release,
)
from ico3d.motion.composing.lexicon import meanings, stressed
from ico3d.motion.composing.takes import Takes, limbs
from ico3d.motion.noise import chance
from ico3d.rig.quaternions import Array

HURRY = 1.4
"""How much faster than it was made a preparation may be."""
APART = (0.9, 2.0)
"""Seconds from one beat to the next, by chance, at least."""
MEANT = 0.75
"""Seconds from a stroke to one that means something, at least."""
LATE = 0.8
"""Seconds by which a meaning may come after its word, where there was no time for it before."""
AGAIN = 5.0
"""Seconds until the same meaning is shown again, at least."""
FAINT = -9.0
"""Decibels; fainter accents get no beat."""
STRONGER, NEAR = 2.0, 0.5
"""Decibels and seconds: an accent with one so much stronger so soon after it gets no beat."""
LONGEST_HOLD = 1.3
"""Seconds that a gesture is held beyond its own hold, at most."""
PAUSE = 0.2
"""Seconds of silence that end a phrase."""
ROUNDS = 2
"""How often a repeated gesture goes round, at least."""
BEATS = (
    (0.50, "beat_right", False),
    (0.14, "beat_right", True),
    (0.18, "beat_both", False),
    (0.10, "open_hand", False),
    (0.08, "open_hands", False),
)
"""Chances of what goes with an accent that means nothing by itself; mirrored, the other hand."""


class Composer:
    """The gestures of one utterance."""

    def __init__(self, clips: dict[str, Clip], seed: int, start: float = 0.0):
        """Nothing is said yet.

        Args:
            clips: By name; at least those of `BEATS`, with either hand.
            seed: Decides all that is by chance.
            start: Seconds before which no gesture begins.
        """
        self._clips, self._seed = clips, seed
        self._takes = Takes(clips)
        self._limbs = {name: limbs(clip) for name, clip in clips.items()}
        self._words: tuple[Word, ...] = ()
        self._levels: Array = np.zeros(0)
        self._end: float | None = None
        self._handed = start  # s up to which all is decided
        self._next = 0  # the first accent's word that is not decided
        self._cues: list[Cue] = []
        self._held: dict[int, Cue] = {}  # not released yet
        self._over: dict[str, float] = {}  # by limb, s when its last gesture is over
        self._struck: dict[str, float] = {}  # by limb, s of its last stroke
        self._shown: dict[str, float] = {}  # by name, s of its last stroke
        self._wanted: list[str] = []
        self._new: list[Direction] = []

    def know(self, words: tuple[Word, ...], levels: Array) -> None:
        """More is known of the speech.

        Args:
            words: All words so far, in the order of time.
            levels: Loudness so far, from the beginning.
        """
        self._words, self._levels = words, levels

    def end(self, seconds: float) -> None:
        """The speech is known as a whole; it is so long."""
        self._end = seconds

    def request(self, name: str) -> None:
        """A gesture to make next.

        Args:
            name: What it means.

        Raises:
            KeyError: If there is none that means it.
        """
        self._takes.one(name, False, 0.0)
        self._wanted.append(name)

    def directions(self, until: float) -> list[Direction]:
        """What is new before a time; nothing that begins before it is decided later."""
        self._new = []
        ended = self._end is not None
        stresses = accents(self._words, self._levels, ended)
        meant = meanings(self._words)
        self._make_wanted(until, stresses)
        for index, accent in enumerate(stresses):
            if accent.word >= self._next and not self._decide(index, stresses, meant, until):
                break
        self._let_go(until)
        self._handed = max(self._handed, until)
        return sorted(self._new, key=_moment)

    def stop(self, now: float) -> list[Direction]:
        """Falls silent: nothing new begins, and what is held is let go once its stroke has arrived.

        Args:
            now: Seconds; gestures that begin later than this are for `Performer.drop`.
        """
        self._new = []
        self._words, self._wanted = (), []
        for cue in list(self._held.values()):
            self._release(cue, max(now, self._earliest(cue)))
        return sorted(self._new, key=_moment)

    def _make_wanted(self, until: float, stresses: tuple[Accent, ...]) -> None:
        """What was asked for comes first: its stroke on the next accent, where one is near."""
        while self._wanted:
            draw = chance(self._seed, len(self._cues), 4)
            name, mirror = self._takes.one(self._wanted[0], False, draw)
            clip, used = self._clips[name], self._used(name, mirror)
            begin = max(self._handed, self._free(used))
            if begin >= until:
                return
            self._wanted.pop(0)
            busy = any(self._over.get(limb, begin) > begin for limb in used)
            skip = clip.marks.stroke - self._taking_up(clip) if busy else 0.0
            soonest = begin + clip.marks.stroke - skip
            near = [a.time for a in stresses if soonest <= a.time <= soonest + NEAR]
            self._cue(name, mirror, begin, near[0] if near else soonest, skip)

    def _decide(
        self, index: int, stresses: tuple[Accent, ...], meant: dict[int, str], until: float
    ) -> bool:
        """Gives an accent a gesture, or none; False if there is still time for that."""
        accent = stresses[index]
        name, mirror = self._choice(index, stresses, meant)
        if name is not None:
            means = accent.word in meant
            for chosen in (accent, *(_soon(index, stresses, meant) if means else ())):
                begin, skip = self._beginning(name, mirror, chosen.time)
                if begin is not None and begin >= until:
                    return False
                if begin is not None:
                    self._cue(name, mirror, begin, chosen.time, skip)
                    self._next = chosen.word + 1
                    return True
        self._next = accent.word + 1
        return True

    def _choice(
        self, index: int, stresses: tuple[Accent, ...], meant: dict[int, str]
    ) -> tuple[str | None, bool]:
        """The gesture of an accent and whether it is mirrored; None for none."""
        accent = stresses[index]
        draw = chance(self._seed, accent.word, 3)
        name = meant.get(accent.word)
        if name is not None and name in self._takes:
            take = self._takes.one(name, False, draw)
            if self._may_mean(name, self._used(*take), accent.time):
                return take
        if not self._may_beat(index, stresses, meant):
            return None, False
        return self._takes.one(*_beat(chance(self._seed, accent.word, 1)), draw)

    def _may_mean(self, name: str, used: frozenset[str], time: float) -> bool:
        last = max((self._struck.get(limb, -np.inf) for limb in used), default=-np.inf)
        return time - last >= MEANT and time - self._shown.get(name, -np.inf) >= AGAIN

    def _may_beat(self, index: int, stresses: tuple[Accent, ...], meant: dict[int, str]) -> bool:
        """Whether an accent is strong enough, long enough after a stroke, and before no other."""
        accent = stresses[index]
        if accent.strength < FAINT or not stressed(self._words[accent.word]):
            return False
        low, high = APART
        gap = low + (high - low) * chance(self._seed, accent.word, 2)
        arms = (self._struck.get(side, -np.inf) for side in ("left", "right"))
        if accent.time - max(arms) < gap:
            return False
        for later in stresses[index + 1 :]:
            away = later.time - accent.time
            if away > NEAR + MEANT:
                break
            name = meant.get(later.word)
            if name is not None and name in self._takes and self._takes.of_hands(name):
                return False
            if away <= NEAR and later.strength > accent.strength + STRONGER:
                return False
        return True

    def _beginning(self, name: str, mirror: bool, stroke: float) -> tuple[float | None, float]:
        """When a gesture begins whose stroke is to arrive then, and what it leaves out.

        None as the first where there is no time for it.
        """
        marks = self._clips[name].marks
        used = self._used(name, mirror)
        over = max((self._over.get(limb, -np.inf) for limb in used), default=-np.inf)
        begin = stroke - marks.stroke
        if begin >= max(over, self._handed):
            return begin, 0.0
        settled = max((self._struck.get(limb, -np.inf) + SETTLE for limb in used), default=-np.inf)
        if over > begin:  # hands are up: they go to where the stroke begins
            lead = self._taking_up(self._clips[name])
            if stroke - lead >= max(settled, self._handed):
                return stroke - lead, marks.stroke - lead
            return None, 0.0
        first = max(self._handed, settled)
        if stroke - first >= marks.stroke / HURRY:
            return first, 0.0
        return None, 0.0

    def _taking_up(self, clip: Clip) -> float:
        """Seconds before its stroke from which hands that are up go on with a gesture."""
        marks = clip.marks
        return min(marks.stroke, max(TAKE_UP, marks.stroke - marks.ready + 0.1))

    def _used(self, name: str, mirror: bool) -> frozenset[str]:
        """The limbs of a gesture, mirrored or not."""
        other = {"left": "right", "right": "left"}
        used = self._limbs[name]
        return frozenset(other.get(limb, limb) for limb in used) if mirror else used

    def _free(self, used: frozenset[str]) -> float:
        """Seconds from which a gesture may take limbs without cutting a stroke off."""
        return max((self._struck.get(limb, -np.inf) + SETTLE for limb in used), default=0.0)

    def _cue(self, name: str, mirror: bool, begin: float, stroke: float, skip: float = 0.0) -> None:
        cue = Cue(len(self._cues), name, mirror, begin, stroke, skip)
        used = self._used(name, mirror)
        for held in list(self._held.values()):
            if self._used(held.name, held.mirror) & used:
                self._release(held, max(begin + BLEND_IN, self._earliest(held)))
        self._cues.append(cue)
        self._new.append(cue)
        self._held[cue.number] = cue
        for limb in used:
            self._struck[limb] = stroke
            self._over[limb] = float("inf")
        self._shown[meaning(name)] = stroke

    def _earliest(self, cue: Cue) -> float:
        return rounded_release(self._clips[cue.name], cue, cue.stroke)

    def _let_go(self, until: float) -> None:
        """Releases what is held long enough before `until`."""
        for cue in list(self._held.values()):
            time = self._natural(cue)
            if time < until:
                self._release(cue, time)

    def _natural(self, cue: Cue) -> float:
        """Seconds at which a gesture is released that no other one takes over from."""
        clip = self._clips[cue.name]
        marks = clip.marks
        hold = marks.release - marks.hold
        if not hold:
            return self._earliest(cue)
        around = rounded_release(clip, cue, cue.stroke + ROUNDS * hold)
        if around > cue.stroke + ROUNDS * hold + 1e-6 or meaning(cue.name) == "wave":
            return max(around, self._handed)
        wanted = min(self._phrase_end(cue.stroke + hold), cue.stroke + hold + LONGEST_HOLD)
        return max(rounded_release(clip, cue, wanted), self._handed)

    def _phrase_end(self, time: float) -> float:
        """Seconds of the next pause after a time, as far as it is known."""
        first = round(time / FRAME)
        if first >= len(self._levels):
            return time
        quiet = self._levels[first:] < self._levels.max() - SPOKEN
        run = round(PAUSE / FRAME)
        for i in np.flatnonzero(quiet):
            if quiet[i : i + run].all():
                return (first + int(i)) * FRAME
        return len(self._levels) * FRAME

    def _release(self, cue: Cue, time: float) -> None:
        self._new.append(Release(cue.number, time))
        del self._held[cue.number]
        over = end_of(self._clips[cue.name], time)
        for limb in self._used(cue.name, cue.mirror):
            self._over[limb] = over


def _beat(draw: float) -> tuple[str, bool]:
    """A gesture without a meaning of its own, and whether it is mirrored, by chance."""
    for part, name, mirror in BEATS[:-1]:
        if draw < part:
            return name, mirror
        draw -= part
    return BEATS[-1][1:]


def _soon(index: int, stresses: tuple[Accent, ...], meant: dict[int, str]) -> list[Accent]:
    """Accents shortly after one, before any that means something itself."""
    found: list[Accent] = []
    for later in stresses[index + 1 :]:
        if later.time - stresses[index].time > LATE or later.word in meant:
            break
        found.append(later)
    return found


def _moment(direction: Direction) -> tuple[float, int]:
    time = direction.begin if isinstance(direction, Cue) else direction.time
    return time, direction.number
