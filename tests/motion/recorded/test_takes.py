"""Clips that somebody recorded come before those of the package; of several, one by chance."""

import numpy as np
import pytest

from ico3d.motion.clip import Clip, Marks, meaning, other_hand
from ico3d.motion.composing.accents import FRAME, Word
from ico3d.motion.composing.composer import BEATS, Composer
from ico3d.motion.composing.cues import Cue
from ico3d.motion.composing.lexicon import requested
from ico3d.motion.composing.takes import Takes
from ico3d.motion.curves import Curve
from ico3d.motion.repertoire import preferring
from ico3d.rig.quaternions import from_rotvec
from support.spoken import speech


def clip(name: str, *sides: str) -> Clip:
    keys = from_rotvec(np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0, 0]]))
    curve = Curve(np.array([0.0, 0.6, 1.5]), keys)
    roles = [f"{side}_wrist" for side in sides] or ["head"]
    return Clip(name, Marks(0.4, 0.6, 0.6, 0.9, 1.5), {role: curve for role in roles})


def clips(*names: str, side: str = "right") -> dict[str, Clip]:
    return {name: clip(name, side) for name in names}


PACKAGE = clips("beat_right", "open_hand", "wave") | clips("beat_left", side="left")
PACKAGE |= {name: clip(name, "left", "right") for name in ("beat_both", "open_hands")}


def test_numbers_are_no_part_of_a_meaning():
    assert [meaning(name) for name in ("wave", "wave_12", "count_one")] == [
        *("wave", "wave", "count_one")
    ]
    assert (other_hand("beat_left"), other_hand("wave")) == ("beat_right", "wave")


def test_recorded_clips_stand_for_those_of_the_package():
    recorded = clips("wave", "wave_2", "raise") | clips("beat_left", side="left")
    found = preferring(recorded, PACKAGE)
    assert set(found) == {*recorded, "beat_both", "open_hand", "open_hands"}
    assert all(found[name] is recorded[name] for name in recorded)


def test_a_clip_made_with_the_wanted_hand_comes_before_one_that_is_mirrored():
    assert Takes(PACKAGE).one("beat_right", True, 0.0) == ("beat_left", False)
    only = Takes(clips("beat_left", side="left"))
    assert only.one("beat_right", False, 0.0) == ("beat_left", True)
    assert only.one("beat_right", True, 0.0) == ("beat_left", False)
    assert Takes(clips("wave")).one("wave", True, 0.9) == ("wave", True)
    assert "beat_right" in only and "wave" not in only
    with pytest.raises(KeyError):
        only.one("wave", False, 0.0)


def test_of_several_takes_each_is_shown():
    recorded = preferring(clips("wave", "wave_2", "wave_3"), PACKAGE)
    shown: set[str] = set()
    for seed in range(20):
        composer = Composer(recorded, seed)
        composer.request("wave")
        (cue,) = [d for d in composer.directions(0.5) if isinstance(d, Cue)]
        shown.add(cue.name)
    assert shown == {"wave", "wave_2", "wave_3"}
    with pytest.raises(KeyError):
        Composer(recorded, 0).request("wave_2x")


def test_another_take_of_a_meaning_does_not_follow_soon():
    words = tuple(Word(t, i * 0.8, i * 0.8 + 0.4) for i, t in enumerate(["hello"] * 12))
    times = np.arange(0, 10, FRAME)
    levels = np.max([-40 * np.abs(times - w.begin - 0.2) / 0.4 for w in words], 0)
    composer = Composer(preferring(clips("wave", "wave_2"), PACKAGE), 3)
    composer.know(words, np.maximum(levels, -70))
    composer.end(10.0)
    cues = [d for d in composer.directions(99.0) if isinstance(d, Cue)]
    waves = [cue.stroke for cue in cues if meaning(cue.name) == "wave"]
    assert len(waves) >= 2 and np.diff(waves).min() >= 5.0


def test_somebody_recorded_with_one_hand_beats_with_it_most_often():
    recorded = preferring(clips("beat_left", side="left"), PACKAGE)
    found: list[Cue] = []
    for seed in range(8):
        composer = Composer(recorded, seed)
        words, levels = speech(seed)
        composer.know(words, levels)
        composer.end(len(levels) * FRAME)
        found += [d for d in composer.directions(99.0) if isinstance(d, Cue)]
    assert {name for _, name, _ in BEATS} - {"beat_right"} <= {cue.name for cue in found}
    beats = [cue for cue in found if cue.name == "beat_left"]
    assert beats and not any(cue.name == "beat_right" for cue in found)
    assert {cue.mirror for cue in beats} == {True, False}


def test_gestures_that_only_this_person_makes_are_asked_for_by_name():
    assert requested("Can you take a bow?") is None
    assert requested("Can you take a bow?", ["bow"]) == "bow"
    assert requested("please raise hand", ["raise_hand", "wave"]) == "raise_hand"
    assert requested("Don't bow", ["bow"]) is None
    assert requested("Can you tell me a big story?", ["big"]) is None
