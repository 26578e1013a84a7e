"""People on a skeleton who make gestures in a film, alone or with speech."""

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
    """A person on a skeleton performing gestures; implements `ico3d.avatar.moving.Moving`.

    Attributes:
        person: Draws the person in a pose.
        performer: Gives the pose at each time of the film.
        face: Gives the expression at each time of the film.
        seconds: Length of the film.
    """

    person: Poseable
    performer: Performer
    face: Face
    seconds: float

    def gaussians(self, seconds: float) -> Gaussians:
        """The whole person in the world at a time of the film."""
        by_role, root = self.performer.at(np.array([seconds]))  # (1, R, 4), (1, 3)
        return self.person.gaussians(by_role[0], root[0], self.face.at(seconds))


def gestures(person: Poseable, actor: Actor | None, names: Sequence[str], seed: int) -> Gesturing:
    """A person who makes gestures one after the other, and lets the hands hang in the end.

    Args:
        person: Draws the person in a pose.
        actor: The same person, for the blinking face; None for a body alone.
        names: Names of the gestures.
        seed: Seed of how the person stands, breathes and blinks meanwhile.

    Raises:
        SettingsError: If no gesture has one of the names.
    """
    directions, seconds = in_turn(person.clips, names)
    performer = person.performer(seed)
    performer.follow(directions)
    face = still_face(actor, seconds, seed) if actor else Face(np.zeros((1, 0), np.float32))
    return Gesturing(person, performer, face, seconds)


def speech(person: Poseable, actor: Actor, sound: Sound, text: str, seed: int) -> Gesturing:
    """A person who talks, with the strokes of gestures on the accents of speech.

    Args:
        person: Draws the person in a pose.
        actor: The same person, for the face.
        sound: The speech.
        text: What is said; if empty, gestures follow the loudness only, not the meaning of words.
        seed: Seed of the choice of gestures, of small movements and of blinks.

    Raises:
        SettingsError: If sound does not drive the person's face.
    """
    seconds, levels = len(sound.samples) / sound.rate, loudness(sound.samples, sound.rate)
    words = timed_words(text, levels, 0.0, seconds) if text else unknown_words(levels)
    composer, performer = Composer(person.clips, seed), person.performer(seed)
    composer.know(words, levels)
    composer.end(seconds)
    performer.follow(composer.directions(float("inf")))
    return Gesturing(person, performer, speaking_face(actor, sound, seed), seconds)
