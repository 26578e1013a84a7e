"""Performances of an actor in a film: speech with a body, or the recorded motion."""

from dataclasses import dataclass

import numpy as np

from ico3d.avatar.film.actor import Actor
from ico3d.avatar.moving import back_and_forth
from ico3d.bundle.planner import Start, plan
from ico3d.capture.capture import Sound
from ico3d.common.expression import expression_rows
from ico3d.errors import SettingsError
from ico3d.head.expressions import FEATURE_RATE
from ico3d.speech.emphasis import Emphasis
from ico3d.speech.eyes import EyeBehaviour
from ico3d.splat.gaussians import Gaussians


@dataclass(frozen=True)
class Face:
    """The expressions of a face through a film.

    Attributes:
        rows: (T, B) expressions, 25 rows per second.
    """

    rows: np.ndarray

    def at(self, seconds: float) -> np.ndarray:
        """(B,) expression at a time in seconds, interpolated linearly between rows."""
        place = min(max(seconds * FEATURE_RATE, 0.0), len(self.rows) - 1.0)
        first = min(int(place), max(len(self.rows) - 2, 0))
        after = min(first + 1, len(self.rows) - 1)
        part = np.float32(place - first)
        return (1 - part) * self.rows[first] + part * self.rows[after]


@dataclass(frozen=True)
class Performance:
    """An actor performing along the recorded motion; implements `ico3d.avatar.moving.Moving`.

    Attributes:
        actor: Who performs.
        seconds: Length of the performance.
        face: Gives the expression at each time of the film.
        times: (P,) ascending times of the film, seconds.
        body_times: (P,) time of the body's clip at each of `times`, seconds; linear in between.
    """

    actor: Actor
    seconds: float
    face: Face
    times: np.ndarray
    body_times: np.ndarray

    def gaussians(self, seconds: float) -> Gaussians:
        """The whole person in the world at a time of the film."""
        body = float(np.interp(seconds, self.times, self.body_times))
        return self.actor.draw(body, self.face.at(seconds))


def speech(actor: Actor, sound: Sound, seed: int) -> Performance:
    """An actor who talks: lips follow the sound, the body gestures and ends at rest.

    Args:
        actor: Who talks.
        sound: The speech.
        seed: Seed of blinks and gestures.

    Raises:
        SettingsError: If sound does not drive the actor's face.
    """
    seconds = len(sound.samples) / sound.rate
    face = speaking_face(actor, sound, seed)
    points = [(0.0, 0.0), (seconds, seconds)]  # without an animation the recorded motion goes on
    if actor.animation is not None:
        rest = Start(actor.animation.rest.end / actor.animation.fps)
        points = plan(actor.animation, rest, seconds, np.random.default_rng(seed))
    times, places = np.array(points).T
    return Performance(actor, seconds, face, times, places)


def motion(actor: Actor, seconds: float, seed: int) -> Performance:
    """An actor who repeats the recorded motion back and forth, with a face that only blinks.

    Args:
        actor: Who moves.
        seconds: Length of the film.
        seed: Seed of the blinks.
    """
    turns = int(seconds // actor.seconds) if actor.seconds > 0 else 0
    times = np.unique([*np.arange(turns + 1) * actor.seconds, seconds])
    places = np.array([back_and_forth(time, actor.seconds) for time in times])
    return Performance(actor, seconds, still_face(actor, seconds, seed), times, places)


def speaking_face(actor: Actor, sound: Sound, seed: int) -> Face:
    """The face of an actor who talks.

    Args:
        actor: Who talks.
        sound: The speech.
        seed: Seed of the blinks.

    Raises:
        SettingsError: If sound does not drive the actor's face.
    """
    if actor.lips is None:
        raise SettingsError(
            "there is no face here that sound moves: --audio is for heads that were trained with "
            "--inputs speech, and for whole persons with such a head."
        )
    lips = actor.lips(sound.samples, sound.rate)
    times = np.arange(len(lips)) / FEATURE_RATE
    brows = Emphasis().values(times, sound.samples, sound.rate)  # (T, 7)
    return _face(actor, lips, np.clip(EyeBehaviour(seed).values(times) + brows, 0, 1))


def still_face(actor: Actor, seconds: float, seed: int) -> Face:
    """The face of an actor that does nothing but blink.

    Args:
        actor: Whose face.
        seconds: Length of the film.
        seed: Seed of the blinks.
    """
    lips = np.zeros((int(seconds * FEATURE_RATE) + 1, 0), np.float32)
    return _face(actor, lips, EyeBehaviour(seed).values(np.arange(len(lips)) / FEATURE_RATE))


def _face(actor: Actor, lips: np.ndarray, eyes: np.ndarray) -> Face:
    return Face(expression_rows(actor.idle, lips, eyes, actor.eye_offset))
