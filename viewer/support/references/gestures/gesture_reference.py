"""People who move, and what Python makes of them: truth for the page's rig, rest and gestures.

Run: python gesture_reference.py OUT

Writes OUT/NAME.safetensors (figure and clips), OUT/sound.i16 (16 kHz) and OUT/reference.json: by
NAME the rig and what it does in random moments, and what needs no rig. Chance has fixed seeds.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.motion.clip import Clip, from_bytes
from ico3d.motion.composing.accents import loudness
from ico3d.motion.composing.composer import Composer
from ico3d.motion.composing.cues import Cue, Direction, Release, rounded_release
from ico3d.motion.composing.gaze import Gaze, direction_to
from ico3d.motion.composing.listening import Listener
from ico3d.motion.composing.performer import Performer
from ico3d.motion.footing import footing
from ico3d.motion.gestures.library import library
from ico3d.motion.living import Living, living
from ico3d.motion.noise import chance, scrambled, wander
from ico3d.motion.recorded.cutting import find_cuts
from ico3d.motion.recorded.making import recorded_clips
from ico3d.motion.recorded.recording import recording_of
from ico3d.motion.repertoire import preferring, repertoire_bytes
from ico3d.motion.roles import ROLES
from ico3d.motion.turning import aligned, arc, power, twist_angle, unit
from ico3d.rig import quaternions
from ico3d.rig.quaternions import Array, normalized
from ico3d.rig.rig import Rig
from support.recorded import performed
from support.rigs import rig_of
from support.spoken import speech

Reference = dict[str, Any]
SEED = 5
RATE = 16_000
GESTURES = ("wave", "small_nod", "beat_right", "open_hands", "count_two", "shrug")
PEOPLE = {
    "spread": (rig_of("SMPL-X", 0.0), None),
    "lowered": (rig_of("MakeHuman", 45.0, 20.0, 0.9), GESTURES),
}
"""By name the rig and which gestures it has, by default all."""


def lacking(rig: Rig) -> Rig:
    """The rig without collarbones, neck and fingers of the right hand: what hung there moves up."""
    gone = ("clavicle.R", "shoulder01.R", "neck01", "neck02", "neck03")
    kept = [i for i, name in enumerate(rig.names) if name not in gone and not _right_finger(name)]
    parents: list[int] = []
    for joint in kept:
        parent = rig.parents[joint]
        while parent >= 0 and parent not in kept:
            parent = rig.parents[parent]
        parents.append(kept.index(parent) if parent >= 0 else -1)
    return Rig(tuple(rig.names[i] for i in kept), tuple(parents), rig.joints[kept])


def _right_finger(name: str) -> bool:
    return name.startswith("finger") and name.endswith(".R")


PEOPLE["lacking"] = (lacking(rig_of("MakeHuman", 70.0)), GESTURES)


def rotations(random: np.random.Generator, *shape: int) -> Array:
    """(*shape, 4) random rotations, of either sign."""
    return normalized(random.normal(size=(*shape, 4)))


def of_quaternions(random: np.random.Generator) -> Reference:
    """What functions of rotations make of random ones, some of them nearly the identity."""
    a, b = rotations(random, 40), rotations(random, 40)
    b[:4] = normalized(a[:4] + 1e-7 * random.normal(size=(4, 4)))
    vectors, part = random.normal(size=(40, 3)), random.uniform(0, 1, 40)
    vectors[:2] = [[0, 0, 0], [1e-9, 0, 0]]
    u, v = unit(random.normal(size=(2, 40, 3)))
    across = unit(np.cross(u, v))
    return {
        **{"a": a, "b": b, "vectors": vectors, "part": part, "u": u, "v": v, "across": across},
        "multiplied": quaternions.multiply(a, b),
        "rotated": quaternions.rotate(a, vectors),
        "from_rotvec": quaternions.from_rotvec(vectors),
        "to_rotvec": quaternions.to_rotvec(a),
        "slerped": quaternions.slerp(a, b, part),
        "power": power(a, part),
        "arc": arc(u, v),
        "aligned": aligned((u, across), (v, across)),
        "twist": twist_angle(a, u[0]),
    }


def of_noise() -> Reference:
    """Hashes of numbers, and how something wanders."""
    numbers = [(0,), (1, 2, 3), (2**32 - 1, 7), (SEED, 20, 0, 1), (2**31, 2**31 + 1)]
    times = np.linspace(0, 5000, 41)
    return {
        "numbers": numbers,
        "scrambled": [scrambled(*row) for row in numbers],
        "chance": [chance(*row) for row in numbers],
        "times": times,
        "wander": wander(times, 9.7, SEED, 3),
    }


def of_curves(clips: dict[str, Clip], random: np.random.Generator) -> list[Reference]:
    """Clips in random moments, also before and after their keys, and mirrored."""
    found: list[Reference] = []
    for name, clip in clips.items():
        times = np.sort(random.uniform(-0.2, clip.marks.end + 0.2, 5))
        other = clip.mirrored()
        found.append(
            {
                "name": name,
                "times": times,
                "roles": [clip.roles, other.roles],
                "poses": [clip.at(times), other.at(times)],
            }
        )
    return found


def random_directions(clips: dict[str, Clip], random: np.random.Generator) -> list[Direction]:
    """Gestures with either hand that come and go at random, many at the same time."""
    found: list[Direction] = []
    for number in range(14):
        name = str(random.choice(list(clips)))
        clip, begin = clips[name], float(random.uniform(0, 12))
        skip = float(random.choice([0.0, random.uniform(0, clip.marks.stroke / 2)]))
        stroke = begin + (clip.marks.stroke - skip) / float(random.uniform(0.8, 1.4))
        cue = Cue(number, name, bool(random.random() < 0.4), begin, stroke, skip)
        found.append(cue)
        if random.random() < 0.8:
            wanted = stroke + float(random.uniform(0, 3))
            found.append(Release(number, rounded_release(clip, cue, wanted)))
    return found


def composed_directions(clips: dict[str, Clip]) -> list[Direction]:
    """Those of a whole speech."""
    words, levels = speech(SEED)
    composer = Composer(clips, SEED)
    composer.know(words, levels)
    composer.end(0.01 * len(levels))
    return composer.directions(float("inf"))


def json_of(directions: list[Direction]) -> list[Reference]:
    """Directions as a message would hold them."""
    return [vars(direction) for direction in directions]


def of_performance(rest: Living, clips: dict[str, Clip], directions: list[Direction]) -> Reference:
    """A body that follows directions, turned at random."""
    random = np.random.default_rng(SEED)
    performer = Performer(rest, clips)
    performer.follow(directions)
    times = random.uniform(0, 16, 30)
    turn = rotations(random, 30, 3)
    pose, root = performer.at(times, turn)
    moved = {"times": times, "turn": turn, "pose": pose, "root": root}
    return {"directions": json_of(directions), **moved}


def of_interruption(rest: Living, clips: dict[str, Clip]) -> Reference:
    """A body whose speech is interrupted while it gestures, and before it would once more."""
    words, levels = speech(SEED)
    cues = [one for one in composed_directions(clips) if isinstance(one, Cue)]
    held = [cue for cue in cues if clips[cue.name].marks.release > clips[cue.name].marks.hold]
    now = held[-1].begin + 0.1
    composer, performer = Composer(clips, SEED), Performer(rest, clips)
    composer.know(words, levels)
    directions = [*composer.directions(now), Cue(99, "shrug", False, now + 0.1, now + 0.9)]
    performer.follow(directions)
    performer.drop(now)
    let_go = composer.stop(now)
    performer.follow(let_go)
    times = np.linspace(now, now + 5, 12)
    pose, root = performer.at(times)
    moved = {"times": times, "pose": pose, "root": root}
    return {"directions": json_of(directions), "now": now, "let_go": json_of(let_go), **moved}


def of_footing(rest: Living, joints: Array, roots: Array, moved: Array) -> Reference:
    """Poses of the living rest where somebody was recorded who stood as nobody stands."""
    rotations, root = footing(rest, joints[0], roots[0]).place(joints[3:], moved[:3])
    return {"rotations": rotations, "root": root}


def of_person(out: Path, name: str, rig: Rig, gestures: tuple[str, ...] | None) -> Reference:
    """A person's file, and what the person does."""
    random = np.random.default_rng(SEED)
    rest = living(rig, SEED)
    made = library(rest.person, gestures) if gestures else library(rest.person)
    if gestures:
        made = preferring(recorded(rest, made), made)
    content = repertoire_bytes(rest, made)
    (out / f"{name}.safetensors").write_bytes(content)
    clips = from_bytes(content)
    times = np.append(random.uniform(0, 3600, 12), 0.0)
    still, moved = rest.at(times)
    poses, roots = rotations(random, 3, len(ROLES)), random.normal(size=(3, 3))
    joints = rest.person.retarget.pose(np.concatenate([poses, still[:3]]))
    found: Reference = {
        "parents": rig.parents,
        "joints": rig.joints,
        "curves": of_curves(clips, random),
        "living": {"times": times, "pose": still, "root": moved},
        "retarget": {"pose": np.concatenate([poses, still[:3]]), "joints": joints},
        "rig": {"rotations": joints[:3], "roots": roots, "matrices": None},
        "random": of_performance(rest, clips, random_directions(clips, random)),
        "footing": of_footing(rest, joints, roots, moved),
    }
    found["rig"]["matrices"] = rig.matrices(joints[:3], roots)[..., :3, :]  # (3, J, 3, 4)
    if gestures is None:
        found["composed"] = of_performance(rest, clips, composed_directions(clips))
        found["interrupted"] = of_interruption(rest, clips)
    return found


def recorded(rest: Living, gestures: dict[str, Clip]) -> dict[str, Clip]:
    """What is found in a recording of some gestures that were made with the left hand."""
    some = {name: gestures[name] for name in ("wave", "small_nod", "beat_right")}
    rotations, _ = performed(rest, some, 20.0, mirror=True)
    recording = recording_of(rest.person.rig, 20.0, rotations)
    clips = recorded_clips(recording, find_cuts(recording))
    assert {"wave", "beat_left"} <= set(clips)
    return clips


def of_gaze(random: np.random.Generator) -> Reference:
    """Somebody who looks at a visitor who is here and there, also behind."""
    gaze = Gaze()
    eyes = np.array([0.0, 1.6, 0.1])
    visitors = random.normal(np.array([0.0, 1.6, 0.5]), (1.5, 0.5, 1.0), (24, 3))
    times = np.cumsum(random.uniform(0, 1.2, 24))
    turns: list[Array] = []
    for visitor, time in zip(visitors, times, strict=True):
        gaze.look(*direction_to(eyes, visitor))
        turns.append(gaze.at(float(time)))
    return {"eyes": eyes, "visitors": visitors, "times": times, "turns": np.stack(turns)}


def of_listening(out: Path, random: np.random.Generator) -> Reference:
    """Sound with pauses, its loudness, and the nods of several listeners."""
    lengths = random.uniform(0.3, 2.5, 20)
    loud = np.repeat(np.arange(20) % 2 == 0, np.round(lengths * RATE).astype(int))
    noise = random.normal(size=len(loud)) * np.where(loud, 0.1, 0.0005)
    pcm = np.clip(np.round(noise * 32768), -32768, 32767).astype(np.int16)
    levels = loudness(pcm / 32768, RATE)
    (out / "sound.i16").write_bytes(pcm.tobytes())
    return {"levels": levels, "nods": [Listener(seed).hear(levels) for seed in range(4)]}


def plain(value: Any) -> Any:
    """Arrays as lists."""
    return value.tolist()


def main() -> None:
    """Does what the file's docstring says."""
    out, random = Path(sys.argv[1]), np.random.default_rng(SEED)
    found = {
        "seed": SEED,
        "quaternions": of_quaternions(random),
        "noise": of_noise(),
        "gaze": of_gaze(random),
        "listening": of_listening(out, random),
        "people": {name: of_person(out, name, *what) for name, what in PEOPLE.items()},
    }
    (out / "reference.json").write_text(json.dumps(found, default=plain))


if __name__ == "__main__":
    main()
