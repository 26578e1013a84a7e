"""Which clip shows a meaning: several may, and either hand."""

from collections.abc import Mapping

from ico3d.motion.clip import Clip, meaning, other_hand

Take = tuple[str, bool]
"""A clip's name, and whether it is mirrored."""


def limbs(clip: Clip) -> frozenset[str]:
    """What a gesture moves: `left`, `right` (arms), `head`."""
    sides = {role.partition("_")[0] for role in clip.curves if role.endswith("_wrist")}
    return frozenset(sides or {"head"})


class Takes:
    """Clips by what they mean: somebody may have been recorded waving twice."""

    def __init__(self, clips: Mapping[str, Clip]):
        """Sorts clips, which are given by name."""
        self._clips = clips
        self._names: dict[str, list[str]] = {}
        for name in clips:
            self._names.setdefault(meaning(name), []).append(name)

    def __contains__(self, meant: str) -> bool:
        """Whether there is a clip that means this, with either hand."""
        return meant in self._names or other_hand(meant) in self._names

    @property
    def meanings(self) -> list[str]:
        """All that the clips mean, in their order."""
        return list(self._names)

    def one(self, meant: str, mirror: bool, draw: float) -> Take:
        """A clip that means something.

        Args:
            meant: What.
            mirror: Whether with the other hand: a clip that was made with it comes before one that
                is mirrored.
            draw: 0 ≤ x < 1 decides among several.

        Raises:
            KeyError: If there is none.
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
        """Whether hands make it."""
        name, _ = self.one(meant, False, 0.0)
        return "head" not in limbs(self._clips[name])
