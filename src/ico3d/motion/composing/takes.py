"""Chooses clips by their meaning: several clips may have one, made with either hand."""

from collections.abc import Mapping

from ico3d.motion.clip import Clip, meaning, other_hand

Take = tuple[str, bool]
"""Name of a clip, and whether it is mirrored."""


def limbs(clip: Clip) -> frozenset[str]:
    """The limbs that a gesture moves: `left` and `right` for arms; `head` if it moves no arm."""
    sides = {role.partition("_")[0] for role in clip.curves if role.endswith("_wrist")}
    return frozenset(sides or {"head"})


class Takes:
    """Clips by meaning; a recording may have several of one meaning, such as two waves."""

    def __init__(self, clips: Mapping[str, Clip]):
        """Sorts clips, given by name, by meaning."""
        self._clips = clips
        self._names: dict[str, list[str]] = {}
        for name in clips:
            self._names.setdefault(meaning(name), []).append(name)

    def __contains__(self, meant: str) -> bool:
        """Whether a clip has this meaning, with the same or the other hand."""
        return meant in self._names or other_hand(meant) in self._names

    @property
    def meanings(self) -> list[str]:
        """All meanings, in the order of the clips."""
        return list(self._names)

    def one(self, meant: str, mirror: bool, draw: float) -> Take:
        """Chooses a clip with a meaning.

        Args:
            meant: The meaning.
            mirror: Whether the gesture is to be made with the other hand. A clip that was made with
                that hand is preferred to one that has to be mirrored.
            draw: Random number 0 ≤ x < 1 that chooses among several clips.

        Raises:
            KeyError: If no clip has the meaning.
        """
        other = other_hand(meant)
        if other == meant:
            names, flipped = self._names[meant], mirror
        else:
            wanted, beside = (other, meant) if mirror else (meant, other)
            flipped = wanted not in self._names
            names = self._names[beside if flipped else wanted]
        return names[int(draw * len(names))], flipped

    def of_hands(self, meant: str) -> bool:
        """Whether gestures of a meaning are made with hands."""
        name, _ = self.one(meant, False, 0.0)
        return "head" not in limbs(self._clips[name])
