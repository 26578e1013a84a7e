"""Nods of a person who listens, at random after the visitor's phrases."""

from ico3d.motion.composing.accents import FRAME, SPOKEN
from ico3d.motion.noise import chance
from ico3d.rig.quaternions import Array

PHRASE = 1.2
"""Seconds that the visitor must have spoken since the last nod, before another one."""
PAUSE = 0.25
"""Seconds of silence after which a nod may follow."""
APART = 3.0
"""Least time in seconds between two nods."""
OFTEN = 0.65
"""Probability of a nod in a pause."""
AUDIBLE = -50.0
"""Loudness in dB below which sound is never speech."""


class Listener:
    """Decides on nods while a visitor's loudness arrives frame by frame."""

    def __init__(self, seed: int):
        """Makes a listener that has heard nothing yet; `seed` decides on the nods."""
        self._seed = seed
        self._frames, self._spoken, self._silent = 0, 0, 0
        self._loudest, self._pauses, self._last = AUDIBLE, 0, -APART

    def hear(self, levels: Array) -> list[tuple[float, str]]:
        """Takes more of the visitor's loudness.

        Args:
            levels: (n,) dB of the frames since the last call, `accents.FRAME` seconds each.

        Returns:
            Nods to begin: seconds since the listener began, and name of the gesture.
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
        """A nod, or none, for a pause of the visitor after a phrase."""
        now = self._frames * FRAME
        self._pauses += 1
        if now - self._last < APART or chance(self._seed, self._pauses) >= OFTEN:
            return []
        self._last, self._spoken = now, 0
        small = chance(self._seed, self._pauses, 1) < 0.7
        return [(now, "small_nod" if small else "nod")]
