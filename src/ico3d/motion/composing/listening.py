"""Nods of somebody who listens: after the visitor's phrases, now and then."""

from ico3d.motion.composing.accents import FRAME, SPOKEN
from ico3d.motion.noise import chance
from ico3d.rig.quaternions import Array

PHRASE = 1.2
"""Seconds that the visitor must have spoken since the last nod."""
PAUSE = 0.25
"""Seconds of silence after which a nod may come."""
APART = 3.0
"""Seconds from nod to nod, at least."""
OFTEN = 0.65
"""How likely a pause gets a nod."""
AUDIBLE = -50.0
"""Decibels below which nobody speaks."""


class Listener:
    """Nods to a visitor whose sound comes frame by frame."""

    def __init__(self, seed: int):
        """Nobody has spoken yet."""
        self._seed = seed
        self._frames, self._spoken, self._silent = 0, 0, 0
        self._loudest, self._pauses, self._last = AUDIBLE, 0, -APART

    def hear(self, levels: Array) -> list[tuple[float, str]]:
        """More of the visitor's loudness.

        Args:
            levels: Decibels of the frames (`accents.FRAME`) since the last call.

        Returns:
            Nods to begin: (seconds since the listener began, name of the gesture).
        """
        found: list[tuple[float, str]] = []
        for level in levels:
            self._frames += 1
            self._loudest = max(self._loudest - 0.01, level, AUDIBLE)
            if level > max(self._loudest - SPOKEN, AUDIBLE):
                self._spoken, self._silent = self._spoken + 1, 0
                continue
            self._silent += 1
            if self._silent == round(PAUSE / FRAME) and self._spoken * FRAME >= PHRASE:
                found += self._pause()
        return found

    def _pause(self) -> list[tuple[float, str]]:
        """The visitor paused after a phrase."""
        now = self._frames * FRAME
        self._pauses += 1
        if now - self._last < APART or chance(self._seed, self._pauses) >= OFTEN:
            return []
        self._last, self._spoken = now, 0
        small = chance(self._seed, self._pauses, 1) < 0.7
        return [(now, "small_nod" if small else "nod")]
