"""What an actor does in a film: it says something, or shows its recorded motion."""

from dataclasses import dataclass

import numpy as np

from ico3d.avatar.film.actor import Actor
from ico3d.avatar.moving import back_and_forth
from ico3d.bundle.planner import Start, plan
from ico3d.capture.capture import Sound
from ico3d.common.expression import expression_rows
from ico3d.errors import SettingsError
from ico3d.head.expressions import FEATURE_RATE
from ico3d.speech.eyes import EyeBehaviour
from ico3d.splat.gaussians import Gaussians


@dataclass(frozen=True)
class Face:
    """What a face does in a film.

    Attributes:
        rows: (T, B) expressions, 25 per second.
    """

    rows: np.ndarray

    def at(self, seconds: float) -> np.ndarray:
        """(B,) at a time, linear between rows."""
        place = min(max(seconds * FEATURE_RATE, 0.0), len(self.rows) - 1.0)
        first = min(int(place), max(len(self.rows) - 2, 0))
        after = min(first + 1, len(self.rows) - 1)
        part = np.float32(place - first)
        return (1 - part) * self.rows[first] + part * self.rows[after]


@dataclass(frozen=True)
class Performance:
    """Somebody who moves (`ico3d.avatar.moving.Moving`) for so many seconds.

    Attributes:
        actor: Who it is.
        seconds: How long the performance lasts.
        face: What the face does.
        times: (P,) seconds of the film.
        body_times: (P,) seconds of the body's motion at these, straight between them.
    """

    actor: Actor
    seconds: float
    face: Face
    times: np.ndarray
    body_times: np.ndarray

    def gaussians(self, seconds: float) -> Gaussians:
        """In the world at a time of the film."""
        body = float(np.interp(seconds, self.times, self.body_times))
        return self.actor.draw(body, self.face.at(seconds))


def speech(actor: Actor, sound: Sound, seed: int) -> Performance:
    """Says something: lips follow the sound, the body gestures and is back at rest in the end.

    Args:
        actor: Who talks.
        sound: What is heard.
        seed: Blinks and gestures follow from it.

    Raises:
        SettingsError: If no sound moves this face.
    """
    seconds = len(sound.samples) / sound.rate
    face = speaking_face(actor, sound, seed)
    points = [(0.0, 0.0), (seconds, seconds)]  # a head alone sways on
    if actor.animation is not None:
        rest = Start(actor.animation.rest.end / actor.animation.fps)
        points = plan(actor.animation, rest, seconds, np.random.default_rng(seed))
    times, places = np.array(points).T
    return Performance(actor, seconds, face, times, places)


def motion(actor: Actor, seconds: float, seed: int) -> Performance:
    """Shows the recorded motion back and forth, with the face at rest but for its eyes.

    Args:
        actor: Who moves.
        seconds: How long the film lasts.
        seed: Blinks follow from it.
    """
    turns = int(seconds // actor.seconds) if actor.seconds > 0 else 0
    times = np.unique([*np.arange(turns + 1) * actor.seconds, seconds])
    places = np.array([back_and_forth(time, actor.seconds) for time in times])
    return Performance(actor, seconds, still_face(actor, seconds, seed), times, places)


def speaking_face(actor: Actor, sound: Sound, seed: int) -> Face:
    """The face of somebody who says something; arguments as for `speech`.

    Raises:
        SettingsError: If no sound moves this face.
    """
    if actor.lips is None:
        raise SettingsError(
            "there is no face here that sound moves: --audio is for heads that were trained with "
            "--inputs speech, and for whole persons with such a head."
        )
    return _face(actor, actor.lips(sound.samples, sound.rate), seed)


def still_face(actor: Actor, seconds: float, seed: int) -> Face:
    """A face that does nothing but blink; arguments as for `motion`."""
    return _face(actor, np.zeros((int(seconds * FEATURE_RATE) + 1, 0), np.float32), seed)


def _face(actor: Actor, lips: np.ndarray, seed: int) -> Face:
    eyes = EyeBehaviour(seed).values(np.arange(len(lips)) / FEATURE_RATE)
    return Face(expression_rows(actor.idle, lips, eyes, actor.eye_offset))
