"""Do strokes of gestures fall on the accents of speech, and is any of them cut off?

    python bench/stress.py SUBJECT.npz [--json F]

Twenty sentences are spoken by espeak-ng in two voices; the composer gets words without times and
the sound as it grows, half a second at a time. A stroke is measured on the body: the moment at
which the movement of the wrist (of the chin, for a nod) before a stroke's mark is over. Its
distance is measured to the nearest peak of the sound's loudness, to the nearest vowel with stress
as espeak-ng tells it, and, for comparison, those of strokes at random moments of the speech.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from ico3d.cli import run_script
from ico3d.common.espeak.speech import Speech, synthesize
from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.composing.accents import FRAME, loudness, smoothed, timed_words
from ico3d.motion.composing.composer import Composer, limbs
from ico3d.motion.composing.cues import SETTLE, Cue, Direction, Release
from ico3d.motion.composing.performer import Performer
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.motion.person import Person
from ico3d.rig.rig import Rig
from ico3d.studio.choice import load_subject

SENTENCES = (
    "Hello, and welcome! I am very glad that you are here.",
    "The museum opens at nine, and the first tour begins at ten.",
    "I don't know exactly, but the old bridge must be three hundred years old.",
    "You can take the bus, or you can walk along the river.",
    "There are two reasons: the weather was bad, and nobody had an umbrella.",
    "Yes, of course, that is a wonderful idea.",
    "No, I have never been to Australia, and I would love to go.",
    "It was a huge building with tiny windows and a green roof.",
    "Let me think about it for a moment before I answer.",
    "First you boil the water, second you add the leaves, third you wait.",
    "Everything that we see here was painted in a single summer.",
    "Thank you so much for the flowers, they are beautiful.",
    "My favourite colour is yellow, because it reminds me of lemons.",
    "The train from Hamburg arrives twenty minutes late today.",
    "If you turn left at the corner you will find a small bakery.",
    "People often ask me why the sky is blue in the morning.",
    "Nobody expected the experiment to work, and yet it did.",
    "He carried the heavy boxes up to the seventh floor without a pause.",
    "Perhaps we should start again, slowly, from the very beginning.",
    "That was all I wanted to say, goodbye and good luck!",
)
VOICES = ("en-us+f3", "en-us")
STEP = 0.5
"""Seconds of sound that come at a time, and of directions that are asked for."""
AHEAD = 1.5
"""Seconds that sound is known before it is heard."""
RATE = 200
"""Poses per second at which movements are measured."""
AROUND = 0.12
"""Seconds before a mark in which its movement is looked for: a part of each stroke."""
SLOW = 0.15
"""Part of the fastest speed below which a movement is over."""


@dataclass(frozen=True)
class Stress:
    """The bench.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic with a body: whose bones.
        seed: Decides what is by chance.
        json: Where the figures go.
    """

    subject: tyro.conf.Positional[Path]
    seed: int = 0
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, the figures."""
        figures = measure(self.subject, self.seed)
        print(json.dumps(figures, indent=1))
        if self.json is not None:
            self.json.write_text(json.dumps(figures, indent=1) + "\n")


def rig_of(subject: Path) -> Rig:
    """The skeleton of a subject file.

    Raises:
        SettingsError: If it has no body.
    """
    person = load_subject(str(subject), whole=True)
    if person.skeleton is None:
        raise SettingsError(f"{subject} has no body.")
    bones = person.skeleton
    return Rig(bones.names, tuple(map(int, bones.parents)), bones.at + person.head_in_world)


def composed(speech: Speech, text: str, clips: dict[str, Clip], seed: int) -> list[Direction]:
    """Directions for a speech that grows."""
    levels = loudness(speech.samples, speech.rate)
    seconds = len(levels) * FRAME
    words = timed_words(text, levels, 0.0, seconds)
    composer = Composer(clips, seed)
    found: list[Direction] = []
    heard = 0.0
    while heard < seconds + 3:
        known = heard + AHEAD + STEP
        composer.know(tuple(w for w in words if w.end <= known), levels[: round(known / FRAME)])
        if known >= seconds:
            composer.end(seconds)
        found += composer.directions(heard + STEP)
        heard += STEP
    return found


def arrival(times: np.ndarray, places: np.ndarray, mark: float) -> float:
    """Seconds at which the fastest movement of (T, 3) places just before a mark is over."""
    speed = np.linalg.norm(np.gradient(places, times, axis=0), axis=1)
    before = np.flatnonzero((times >= mark - AROUND) & (times <= mark))
    fastest = before[np.argmax(speed[before])]
    slow = np.flatnonzero(speed[fastest:] < SLOW * speed[fastest])
    return float(times[fastest + slow[0]]) if len(slow) else float("inf")


def distances(moments: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    """Seconds from each moment to the nearest peak."""
    return np.abs(moments[:, None] - peaks).min(1)


def loud_peaks(speech: Speech) -> np.ndarray:
    """Seconds of the peaks of loudness within 12 dB of the loudest: syllables that stand out."""
    level = smoothed(loudness(speech.samples, speech.rate))
    inner = level[1:-1]
    peaks = (inner > level[:-2]) & (inner >= level[2:]) & (inner > level.max() - 12)
    return (1 + np.flatnonzero(peaks)) * FRAME


def stressed_vowels(speech: Speech) -> np.ndarray:
    """Seconds of the middles of vowels with primary stress."""
    ends = [p.time for p in speech.events[1:]] + [len(speech.samples) / speech.rate]
    return np.array(
        [0.5 * (p.time + e) for p, e in zip(speech.events, ends, strict=True) if "ˈ" in p.symbol]
    )


def struck(
    person: Person, cue: Cue, clip: Clip, times: np.ndarray, pose: np.ndarray, root: np.ndarray
) -> float:
    """Seconds at which the hand, or the chin, arrives."""
    near = np.abs(times - cue.stroke) <= 0.5
    rotations = person.retarget.pose(pose[near])
    used = limbs(clip)
    side = "left" if (used == {"right"}) == cue.mirror else "right"
    role = "head" if used == {"head"} else f"{side}_wrist"
    point = person.chin if role == "head" else person.place(role)
    return arrival(times[near], person.carried(role, point, rotations, root[near]), cue.stroke)


def was_cut(cue: Cue, moment: float, directions: list[Direction], clips: dict[str, Clip]) -> bool:
    """Whether a stroke did not arrive, or was left before it had stayed."""
    if abs(moment - cue.stroke) > 0.1:
        return True
    for other in directions:
        if isinstance(other, Release):
            stays = SETTLE if clips[cue.name].marks.release > clips[cue.name].marks.hold else 0.0
            if other.number == cue.number and other.time < cue.stroke + stays - 1e-9:
                return True
        elif other.number > cue.number and other.begin < cue.stroke and _shared(cue, other, clips):
            return True
    return False


def _shared(cue: Cue, other: Cue, clips: dict[str, Clip]) -> bool:
    """Whether two gestures need the same arm, or both the head."""
    swapped = {"left": "right", "right": "left"}
    one, two = (
        {swapped.get(limb, limb) if c.mirror else limb for limb in limbs(clips[c.name])}
        for c in (cue, other)
    )
    return bool(one & two)


def measure(subject: Path, seed: int) -> dict[str, Any]:
    """Speaks, composes, performs and measures."""
    rest = living(rig_of(subject), seed)
    clips = library(rest.person)
    to_peak, to_vowel, chance_peak, chance_vowel = [], [], [], []
    cut, count, seconds = 0, 0, 0.0
    random = np.random.default_rng(seed)
    names: dict[str, int] = {}
    for number, text in enumerate(SENTENCES):
        for voice in VOICES:
            speech = synthesize(text, voice)
            directions = composed(speech, text, clips, seed + number)
            performer = Performer(rest, clips)
            performer.follow(directions)
            length = len(speech.samples) / speech.rate
            times = np.arange(0, length + 3, 1 / RATE)
            pose, root = performer.at(times)
            moments: list[float] = []
            for cue in (d for d in directions if isinstance(d, Cue)):
                count += 1
                names[cue.name] = names.get(cue.name, 0) + 1
                moment = struck(rest.person, cue, clips[cue.name], times, pose, root)
                moments.append(moment)
                cut += was_cut(cue, moment, directions, clips)
            peaks, vowels = loud_peaks(speech), stressed_vowels(speech)
            if moments:
                to_peak.append(distances(np.array(moments), peaks))
                to_vowel.append(distances(np.array(moments), vowels))
            guesses = random.uniform(0, length, 200)
            chance_peak.append(distances(guesses, peaks))
            chance_vowel.append(distances(guesses, vowels))
            seconds += length

    def median(parts: list[np.ndarray]) -> float:
        return round(1000 * float(np.median(np.concatenate(parts))), 1)

    peak = np.concatenate(to_peak)
    return {
        "strokes": count,
        "strokes_per_minute": round(60 * count / seconds, 1),
        "median_ms_to_loudness_peak": median(to_peak),
        "p90_ms_to_loudness_peak": round(1000 * float(np.quantile(peak, 0.9)), 1),
        "by_chance_ms_to_loudness_peak": median(chance_peak),
        "median_ms_to_stressed_vowel": median(to_vowel),
        "by_chance_ms_to_stressed_vowel": median(chance_vowel),
        "cut_off": cut,
        "gestures": names,
    }


if __name__ == "__main__":
    sys.exit(run_script(Stress))
