"""Films of people on a skeleton, who do what nobody recorded."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.avatar.film.actor import Actor
from ico3d.avatar.film.performance import Face, speaking_face, still_face
from ico3d.avatar.poseable import Poseable
from ico3d.capture.capture import Sound
from ico3d.motion.composing.accents import loudness, timed_words, unknown_words
from ico3d.motion.composing.composer import Composer
from ico3d.motion.composing.in_turn import in_turn
from ico3d.motion.composing.performer import Performer
from ico3d.splat.gaussians import Gaussians


@dataclass(frozen=True)
class Gesturing:
    """Somebody who moves (`ico3d.avatar.moving.Moving`) as they are told.

    Attributes:
        person: Who it is.
        performer: Knows what is to be done.
        face: What the face does.
        seconds: How long the film lasts.
    """

    person: Poseable
    performer: Performer
    face: Face
    seconds: float

    def gaussians(self, seconds: float) -> Gaussians:
        """In the world at a time of the film."""
        by_role, root = self.performer.at(np.array([seconds]))  # (1, R, 4), (1, 3)
        return self.person.gaussians(by_role[0], root[0], self.face.at(seconds))


def gestures(person: Poseable, actor: Actor | None, names: Sequence[str], seed: int) -> Gesturing:
    """Somebody who makes gestures one after the other and lets the hands hang again.

    Args:
        person: Who.
        actor: The same person, whose face blinks; None for a body alone.
        names: Of the gestures.
        seed: How they stand, breathe and blink meanwhile follows from it.

    Raises:
        SettingsError: If there is no gesture of a name.
    """
    directions, seconds = in_turn(person.clips, names)
    performer = person.performer(seed)
    performer.follow(directions)
    face = still_face(actor, seconds, seed) if actor else Face(np.zeros((1, 0), np.float32))
    return Gesturing(person, performer, face, seconds)


def speech(person: Poseable, actor: Actor, sound: Sound, text: str, seed: int) -> Gesturing:
    """Somebody who says something and gestures with it, strokes on its accents.

    Args:
        person: Who.
        actor: The same person.
        sound: What is heard.
        text: What is said in it; empty where nobody knows: then no word means a gesture.
        seed: All that is by chance follows from it.

    Raises:
        SettingsError: If no sound moves this face.
    """
    seconds, levels = len(sound.samples) / sound.rate, loudness(sound.samples, sound.rate)
    words = timed_words(text, levels, 0.0, seconds) if text else unknown_words(levels)
    composer, performer = Composer(person.clips, seed), person.performer(seed)
    composer.know(words, levels)
    composer.end(seconds)
    performer.follow(composer.directions(float("inf")))
    return Gesturing(person, performer, speaking_face(actor, sound, seed), seconds)
