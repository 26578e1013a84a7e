"""Chooses gestures for speech, and places their strokes on its accents.

The speech may still be growing: directions that were handed out are never changed. Every stroke
that begins also arrives, and its end is held for a moment; a gesture is held until the phrase ends
or the next gesture needs the hands.
"""

from collections import deque

import numpy as np

from ico3d.motion.clip import Clip, meaning
from ico3d.motion.composing.accents import FRAME, SPOKEN, Accent, GrowingAccents, Word
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
"""Largest factor by which a preparation is played faster than in its clip."""
APART = (0.9, 2.0)
"""Range of the random least time in seconds from a stroke to a beat."""
MEANT = 0.75
"""Least time in seconds from a stroke to the stroke of a gesture with a meaning."""
LATE, WAVING = 0.8, 1.6
"""Seconds after its word at which a meaning may still be shown, if there was no time before; and a
wave, which takes longer to raise than a hello lasts."""
AGAIN = 5.0
"""Least time in seconds until the same meaning is shown again."""
FAINT = -9.0
"""Accents below this strength, in dB, get no beat and no nod."""
NOD, NODS_APART = "small_nod", (1.1, 2.6)
"""What the head does with accents for which hands do nothing, and the range of the random least
time in seconds from one of its strokes to the next: who stresses a word moves the head, too."""
STRONGER, NEAR = 2.0, 0.5
"""An accent gets no beat if one is stronger by this many dB within this many seconds after it."""
LONGEST_HOLD = 1.3
"""Longest time in seconds for which a gesture is held beyond the hold of its clip."""
PAUSE = 0.2
"""Seconds of silence that end a phrase."""
ROUNDS = 2
"""Number of times that the hold of a gesture is repeated at least, if it is a motion."""
BEATS = (
    (0.48, "beat_right", False),
    (0.20, "beat_right", True),
    (0.14, "beat_both", False),
    (0.10, "open_hand", False),
    (0.08, "open_hands", False),
)
"""Gestures for accents without a meaning: probability, name, and whether mirrored."""


class Composer:
    """Composes the gestures of one utterance; all times are seconds from its beginning."""

    def __init__(self, clips: dict[str, Clip], seed: int, start: float = 0.0):
        """Makes a composer that knows nothing of the speech yet.

        Args:
            clips: Clips by name; an accent whose gesture is not among them gets none.
            seed: Seed of all random choices.
            start: Time before which no gesture begins.
        """
        self._clips, self._seed = clips, seed
        self._takes = Takes(clips)
        self._limbs = {name: limbs(clip) for name, clip in clips.items()}
        self._words: tuple[Word, ...] = ()
        self._levels: Array = np.zeros(0)
        self._end: float | None = None
        self._accents = GrowingAccents()
        self._meant: dict[int, str] = {}  # gestures that words call for
        self._handed = start  # time up to which all is decided
        self._next = 0  # index of the first word whose accent is not decided
        self._cues: list[Cue] = []
        self._held: dict[int, Cue] = {}  # cues that are not released yet, by number
        self._over: dict[str, float] = {}  # by limb, end of its last gesture
        self._struck: dict[str, float] = {}  # by limb, time of its last stroke
        self._shown: dict[str, float] = {}  # by meaning, time of its last stroke
        self._wanted: list[str] = []
        self._bare = deque[Accent]()  # stressed, and hands do nothing for them
        self._new: list[Direction] = []

    def know(self, words: tuple[Word, ...], levels: Array) -> None:
        """Updates what is known of the speech.

        Args:
            words: All words known so far, in order of time; those known before come first.
            levels: (n,) loudness known so far, from the beginning, dB (`accents.loudness`).
        """
        if words is not self._words:
            self._words, self._meant = words, meanings(words)
        self._levels = levels

    def end(self, seconds: float) -> None:
        """Says that all of the speech is known, and how long it is."""
        self._end = seconds

    def request(self, name: str) -> None:
        """Asks for a gesture to be made next.

        Args:
            name: Meaning of the gesture.

        Raises:
            KeyError: If no clip has this meaning.
        """
        self._takes.one(name, False, 0.0)
        self._wanted.append(name)

    def directions(self, until: float) -> list[Direction]:
        """New cues and releases before the time `until`, in order of time.

        Later calls return nothing that begins before `until`.
        """
        self._new = []
        stresses = self._accents.up_to(self._words, self._levels, self._end is not None)
        meant = self._meant
        self._make_wanted(until, stresses)
        for index, accent in enumerate(stresses):
            if accent.word >= self._next and not self._decide(index, stresses, meant, until):
                break
            self._nod(until)
        self._let_go(until)
        self._handed = max(self._handed, until)
        return sorted(self._new, key=_moment)

    def stop(self, now: float) -> list[Direction]:
        """Ends the speech: no gesture begins, and held ones are released after their strokes.

        Args:
            now: Time at which the speech stops; gestures that begin later have to be removed by
                `Performer.drop`.

        Returns:
            The releases.
        """
        self._new = []
        self._words, self._wanted, self._accents = (), [], GrowingAccents()
        self._bare.clear()
        for cue in list(self._held.values()):
            self._release(cue, max(now, self._earliest(cue)))
        return sorted(self._new, key=_moment)

    def _make_wanted(self, until: float, stresses: tuple[Accent, ...]) -> None:
        """Cues requested gestures, with their strokes on the next accent if one is near."""
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
        """Decides on the gesture of an accent; False if it would begin at `until` or later."""
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
        if NOD in self._takes and self._is_stressed(accent):
            self._bare.append(accent)
        self._next = accent.word + 1
        return True

    def _nod(self, until: float) -> None:
        """Cues nods to stressed accents for which hands do nothing, as often as it is time to."""
        while self._bare:
            accent = self._bare[0]
            low, high = NODS_APART
            gap = low + (high - low) * chance(self._seed, accent.word, 5)
            if accent.time - self._struck.get("head", -np.inf) >= gap:
                name, mirror = self._takes.one(NOD, False, chance(self._seed, accent.word, 3))
                begin, skip = self._beginning(name, mirror, accent.time)
                if begin is not None and begin >= until:
                    return
                if begin is not None:
                    self._cue(name, mirror, begin, accent.time, skip)
            self._bare.popleft()

    def _is_stressed(self, accent: Accent) -> bool:
        return accent.strength >= FAINT and stressed(self._words[accent.word])

    def _choice(
        self, index: int, stresses: tuple[Accent, ...], meant: dict[int, str]
    ) -> tuple[str | None, bool]:
        """Name of the gesture of an accent, None for none, and whether it is mirrored."""
        accent = stresses[index]
        draw = chance(self._seed, accent.word, 3)
        name = meant.get(accent.word)
        if name is not None and name in self._takes:
            take = self._takes.one(name, False, draw)
            if self._may_mean(name, self._used(*take), accent.time):
                return take
        if not self._may_beat(index, stresses, meant):
            return None, False
        beat, mirror = _beat(chance(self._seed, accent.word, 1))
        return self._takes.one(beat, mirror, draw) if beat in self._takes else (None, False)

    def _may_mean(self, name: str, used: frozenset[str], time: float) -> bool:
        last = max((self._struck.get(limb, -np.inf) for limb in used), default=-np.inf)
        return time - last >= MEANT and time - self._shown.get(name, -np.inf) >= AGAIN

    def _may_beat(self, index: int, stresses: tuple[Accent, ...], meant: dict[int, str]) -> bool:
        """Whether an accent may get a beat.

        It must be strong enough and long enough after the last stroke, and neither a stronger
        accent nor a gesture with a meaning may follow soon.
        """
        accent = stresses[index]
        if not self._is_stressed(accent):
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
        """When a gesture has to begin so that its stroke arrives at a time.

        Returns:
            Time of the beginning, None if there is no time for the gesture; and how many seconds of
            the clip's beginning are skipped.
        """
        marks = self._clips[name].marks
        used = self._used(name, mirror)
        over = max((self._over.get(limb, -np.inf) for limb in used), default=-np.inf)
        begin = stroke - marks.stroke
        if begin >= max(over, self._handed):
            return begin, 0.0
        settled = max((self._struck.get(limb, -np.inf) + SETTLE for limb in used), default=-np.inf)
        if over > begin:  # hands are still up: the clip begins later, near its stroke
            lead = self._taking_up(self._clips[name])
            if stroke - lead >= max(settled, self._handed):
                return stroke - lead, marks.stroke - lead
            return None, 0.0
        first = max(self._handed, settled)
        if stroke - first >= marks.stroke / HURRY:
            return first, 0.0
        return None, 0.0

    def _taking_up(self, clip: Clip) -> float:
        """Seconds before its stroke at which a gesture begins if hands are still up."""
        marks = clip.marks
        return min(marks.stroke, max(TAKE_UP, marks.stroke - marks.ready + 0.1))

    def _used(self, name: str, mirror: bool) -> frozenset[str]:
        """The limbs that a gesture moves, mirrored or not."""
        other = {"left": "right", "right": "left"}
        used = self._limbs[name]
        return frozenset(other.get(limb, limb) for limb in used) if mirror else used

    def _free(self, used: frozenset[str]) -> float:
        """Earliest time at which a gesture may take limbs without cutting off a stroke."""
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
        """Releases held gestures whose natural release is before `until`."""
        for cue in list(self._held.values()):
            time = self._natural(cue)
            if time < until:
                self._release(cue, time)

    def _natural(self, cue: Cue) -> float:
        """Time at which a gesture is released if no other gesture needs its limbs."""
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
        """Time of the next pause after a time; if there is none, a later one than matters."""
        first = round(time / FRAME)
        if first >= len(self._levels):
            return time
        run = round(PAUSE / FRAME)
        last = first + round(LONGEST_HOLD / FRAME) + run  # nobody holds a gesture for longer
        quiet = self._levels[first:last] < self._levels.max() - SPOKEN
        for i in np.flatnonzero(quiet):
            if quiet[i : i + run].all():
                return (first + int(i)) * FRAME
        return (first + len(quiet)) * FRAME

    def _release(self, cue: Cue, time: float) -> None:
        self._new.append(Release(cue.number, time))
        del self._held[cue.number]
        over = end_of(self._clips[cue.name], time)
        for limb in self._used(cue.name, cue.mirror):
            self._over[limb] = over


def _beat(draw: float) -> tuple[str, bool]:
    """A gesture of `BEATS`, and whether it is mirrored, chosen by a random number 0 ≤ draw < 1."""
    for part, name, mirror in BEATS[:-1]:
        if draw < part:
            return name, mirror
        draw -= part
    return BEATS[-1][1:]


def _soon(index: int, stresses: tuple[Accent, ...], meant: dict[int, str]) -> list[Accent]:
    """Accents up to `LATE` seconds after one with a meaning, before the next one with a meaning."""
    found: list[Accent] = []
    late = WAVING if meant[stresses[index].word] == "wave" else LATE
    for later in stresses[index + 1 :]:
        if later.time - stresses[index].time > late or later.word in meant:
            break
        found.append(later)
    return found


def _moment(direction: Direction) -> tuple[float, int]:
    time = direction.begin if isinstance(direction, Cue) else direction.time
    return time, direction.number
