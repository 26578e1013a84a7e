"""What a synthetic person's head does: speaks, blinks, moves the brows, sways."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ico3d.common.espeak.speech import Phoneme, synthesize
from ico3d.common.expression import EYE_NAMES
from ico3d.errors import MissingExtraError
from ico3d.studio.acting.articulation import articulate
from ico3d.studio.acting.sentences import SENTENCES, sentences_of
from ico3d.studio.person.subject import Subject

SOUND_RATE = 16000
PAUSE = 0.25
"""Seconds of silence between sentences."""
BLINK = (0.08, 0.03, 0.15)
"""Seconds in which a lid closes, for which it stays closed, and in which it opens.

Avatars blink by `speech.eyes`. Recordings do not: the same seed has to give the same recording, as
`studio.truth` computes the truth of older ones anew and published figures were measured on them.
"""
YAW, PITCH, ROLL = 6.0, 3.5, 2.5
"""Largest rotations of the head's sway, degrees."""
SHIFT = (0.018, 0.006, 0.012)
"""Largest displacements of the head's sway along x, y, z, metres."""

MIMICRY = (
    (("browInnerUp",), 0.8),
    (("browOuterUpLeft",), 0.9),
    (("browOuterUpRight",), 0.9),
    (("browDownLeft", "browDownRight"), 0.8),
    (("eyeSquintLeft", "cheekSquintLeft"), 0.9),
    (("eyeSquintRight", "cheekSquintRight"), 0.9),
    (("eyeWideLeft", "eyeWideRight"), 0.8),
    (("noseSneerLeft",), 0.8),
    (("noseSneerRight",), 0.8),
    (("cheekPuffLeft",), 0.6),
    (("cheekPuffRight",), 0.6),
    (("mouthSmileLeft", "mouthSmileRight"), 0.4),
    (("mouthSmileLeft", "mouthDimpleLeft"), 0.3),
    (("mouthFrownLeft", "mouthFrownRight", "mouthShrugLower"), 0.3),
    (("mouthPucker", "mouthFunnel"), 0.3),
    (("mouthLeft", "jawLeft"), 0.3),
    (("mouthRight", "jawRight"), 0.3),
)
"""Facial expressions of a lively person besides speech: blendshapes that move together.

They move mostly brows, lids, nose and cheeks, because the mouth has to speak.
"""
GAZE = (
    (("eyeLookInLeft", "eyeLookOutRight"), ("eyeLookOutLeft", "eyeLookInRight")),
    (("eyeLookUpLeft", "eyeLookUpRight"), ("eyeLookDownLeft", "eyeLookDownRight")),
)
"""Blendshapes that turn both eyes to the person's right or left, up or down."""
LOOK = (0.8, 0.5)
"""How far the gaze wanders sideways, and up or down, as a blendshape weight."""
SACCADE = 0.06
"""Seconds in which the eyes jump to a new direction."""


@dataclass(frozen=True)
class Performance:
    """F frames of a talking person.

    Attributes:
        samples: (S,) float32 sound at `SOUND_RATE`; sample 0 belongs to frame 0.
        text: What is said.
        phonemes: Phonemes that are spoken, with times in seconds.
        weights: (F, K) float32 blendshape weights.
        eyes: (F, 7) float32 in the order of `EYE_NAMES`.
        world_from_head: (F, 4, 4) float64 head poses.
        joints: (F, J, 4, 4) float64 transforms of each joint of a whole person, from canonical head
            space at rest to the world; None for a bust.
        cloth: (F, N, 3) float32 positions in the world, metres, of the person's last N vertices,
            which are swinging cloth and follow no joints; None without such cloth.
    """

    samples: np.ndarray
    text: str
    phonemes: tuple[Phoneme, ...]
    weights: np.ndarray
    eyes: np.ndarray
    world_from_head: np.ndarray
    joints: np.ndarray | None = None
    cloth: np.ndarray | None = None

    def vertices(self, subject: Subject, frame: int) -> np.ndarray:
        """(V, 3) float32 vertices of the mesh in a frame, in canonical head space, metres."""
        shape = subject.posed(self.weights[frame])
        if self.joints is None or subject.skeleton is None:
            return shape
        # Into head space before blending: float32 stays exact at the face.
        inverse = np.linalg.inv(self.world_from_head[frame])
        vertices = subject.skeleton.skinned(shape, inverse @ self.joints[frame])
        if self.cloth is not None:
            swinging = self.cloth[frame] @ inverse[:3, :3].T + inverse[:3, 3]
            vertices[-len(swinging) :] = swinging
        return vertices


def perform(
    subject: Subject, text: str, frames: int, fps: float, seed: int, lively: bool
) -> Performance:
    """Makes up the performance of a head.

    Args:
        subject: The person.
        text: What to say, repeated until the end; if empty, the built-in sentences.
        frames: Number of frames.
        fps: Frames per second.
        seed: Seed of voice, order of sentences, blinks, brows and sway.
        lively: Whether to add expressions and glances that cannot be inferred from the sound.

    Raises:
        MissingExtraError: If espeakng-loader or soxr is not installed.
    """
    random = np.random.default_rng(seed)
    seconds = frames / fps
    voice = f"en-us+{'m' if subject.male else 'f'}{1 + seed % 3}"
    samples, phonemes, said = _speak(text, seconds, voice, 45 + int(random.integers(15)), random)
    times = np.arange(frames) / fps
    weights = articulate(phonemes, seconds, subject.visemes, times)
    eyes = _eyes(times, random)
    for column, name in enumerate(EYE_NAMES):
        if name in subject.blendshape_names:
            weights[:, subject.blendshape_names.index(name)] = eyes[:, column]
    poses = _sway(times, subject, random)
    if lively:
        _add_mimicry(weights, subject, times, random)
        for column, name in enumerate(EYE_NAMES):
            if name in subject.blendshape_names:
                eyes[:, column] = weights[:, subject.blendshape_names.index(name)]
    return Performance(samples, said, phonemes, weights, eyes, poses)


def _speak(
    text: str, seconds: float, voice: str, pitch: int, random: np.random.Generator
) -> tuple[np.ndarray, tuple[Phoneme, ...], str]:
    """Sound (S,) at 16 kHz of exactly `seconds`, its phonemes, and the text."""
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "train", "resampling the voice") from None
    parts, phonemes, said, now = [np.zeros(int(PAUSE * SOUND_RATE), np.float32)], [], [], PAUSE
    script = _script(text, random)
    while now < seconds:
        sentence = next(script)
        speech = synthesize(sentence, voice, rate=165, pitch=pitch)
        sound = soxr.resample(speech.samples, speech.rate, SOUND_RATE)
        gap = np.zeros(int(PAUSE * SOUND_RATE), np.float32)
        phonemes += [Phoneme(now + p.time, p.symbol) for p in speech.events]
        phonemes.append(Phoneme(now + len(sound) / SOUND_RATE, ""))
        parts += [sound.astype(np.float32), gap]
        said.append(sentence)
        now += (len(sound) + len(gap)) / SOUND_RATE
    samples = np.concatenate(parts)[: round(seconds * SOUND_RATE)]
    heard = tuple(p for p in phonemes if p.time < seconds)
    return samples, heard, " ".join(said)


def _script(text: str, random: np.random.Generator) -> Iterator[str]:
    """Sentences without end: the given ones in order, or our own, shuffled anew each round."""
    given = sentences_of(text)
    while True:
        yield from given or (SENTENCES[i] for i in random.permutation(len(SENTENCES)))


def _eyes(times: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(F, 7) brows that wander with the talk and lids that blink."""
    lift = np.clip(wander(times, 0.5, random), 0, None) ** 1.3
    frown = np.clip(-wander(times, 0.35, random) - 0.2, 0, None)
    tilt = 0.12 * wander(times, 0.3, random)
    blink = _blinks(times, random)
    columns = {
        "browDownLeft": 0.55 * frown * (1 + tilt),
        "browDownRight": 0.55 * frown * (1 - tilt),
        "browInnerUp": 0.6 * lift,
        "browOuterUpLeft": 0.5 * lift * (1 + 2 * tilt),
        "browOuterUpRight": 0.5 * lift * (1 - 2 * tilt),
        "eyeBlinkLeft": blink,
        "eyeBlinkRight": blink * 0.98,
    }
    return np.clip(np.stack([columns[n] for n in EYE_NAMES], 1), 0, 1).astype(np.float32)


def _add_mimicry(
    weights: np.ndarray, subject: Subject, times: np.ndarray, random: np.random.Generator
) -> None:
    """Adds moods and glances to weights (F, K): each comes and goes on its own."""

    def add(names: tuple[str, ...], values: np.ndarray) -> None:
        for name in set(names).intersection(subject.blendshape_names):
            column = subject.blendshape_names.index(name)
            weights[:, column] = np.clip(weights[:, column] + values, 0, 1)

    for names, most in MIMICRY:
        add(names, most * np.clip(1.6 * wander(times, 0.8, random) - 0.3, 0, 1))
    for (one, other), most in zip(GAZE, LOOK, strict=True):
        turn = most * _glances(times, random)  # (F,)
        add(one, np.clip(turn, 0, None))
        add(other, np.clip(-turn, 0, None))


def _glances(times: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(F,) in [-1, 1]: a gaze that rests for 0.3 to about 3 s, then jumps."""
    starts = np.cumsum(0.3 + random.gamma(2.0, 0.4, size=int(times[-1]) * 4 + 2))  # (J,)
    targets = np.append(0.0, random.uniform(-1, 1, len(starts)))  # (J + 1,)
    done = np.clip((times[:, None] - starts) / SACCADE, 0, 1)  # (F, J)
    return targets[0] + done @ np.diff(targets)


def _blinks(times: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(F,) lid closure with blinks every 1.2 s to about 6 s."""
    closing, shut, opening = BLINK
    lids = np.zeros(len(times))
    start = random.uniform(0.3, 2.0)
    while start < times[-1]:
        since = times - start
        down = np.clip(since / closing, 0, 1)
        up = np.clip((since - closing - shut) / opening, 0, 1)
        lids = np.maximum(lids, down * down * (3 - 2 * down) - up * up * (3 - 2 * up))
        start += 1.2 + random.gamma(2.0, 1.1)
    return lids


def wander(times: np.ndarray, fastest: float, random: np.random.Generator) -> np.ndarray:
    """(F,) a smooth random curve in [-1, 1] at `times`, without frequencies above `fastest` Hz."""
    frequencies = random.uniform(0.15, 1.0, 5) * fastest
    phases = random.uniform(0, 2 * np.pi, 5)
    waves = np.sin(2 * np.pi * frequencies * times[:, None] + phases)  # (F, 5)
    return np.clip(waves.sum(axis=1) / 3, -1, 1)


def _sway(times: np.ndarray, subject: Subject, random: np.random.Generator) -> np.ndarray:
    """(F, 4, 4) head poses: the whole bust turns about the base of the neck."""
    yaw, pitch, roll = (
        np.radians(limit) * wander(times, 0.3, random) for limit in (YAW, PITCH, ROLL)
    )
    shift = np.stack([limit * wander(times, 0.25, random) for limit in SHIFT], 1)  # (F, 3)
    rotation = _about(1, yaw) @ _about(0, pitch) @ _about(2, roll)  # (F, 3, 3)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, :3] = rotation
    poses[:, :3, 3] = (
        subject.head_in_world + subject.neck_base - rotation @ subject.neck_base + shift
    )
    return poses


def _about(axis: int, angles: np.ndarray) -> np.ndarray:
    """(F, 3, 3) rotations about a coordinate axis."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.tile(np.eye(3), (len(angles), 1, 1))
    matrices[:, one, one] = matrices[:, two, two] = np.cos(angles)
    matrices[:, one, two], matrices[:, two, one] = -np.sin(angles), np.sin(angles)
    return matrices
