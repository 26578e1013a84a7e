"""Gestures that somebody names, one after the other."""

from collections.abc import Mapping, Sequence

from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.composing.cues import Cue, Direction, Release, end_of, rounded_release

BEGIN = 0.6
"""Seconds before the first gesture."""
PAUSE = 0.5
"""Seconds between two, in which hands hang."""
HELD = 2
"""How often what may be repeated is gone round; a pose is held for so many of its own holds."""


def in_turn(clips: Mapping[str, Clip], names: Sequence[str]) -> tuple[list[Direction], float]:
    """Directions for gestures as they were made, each with its own time.

    Args:
        clips: By name.
        names: Which, in their order; a name may come again.

    Returns:
        Cues and releases, and the seconds at which hands hang again.

    Raises:
        SettingsError: If there is no gesture of a name.
    """
    found: list[Direction] = []
    begin = BEGIN
    for number, name in enumerate(names):
        if name not in clips:
            raise SettingsError(f"there is no gesture '{name}': there are {', '.join(clips)}.")
        clip = clips[name]
        marks = clip.marks
        cue = Cue(number, name, False, begin, begin + marks.stroke)
        wanted = cue.stroke + HELD * (marks.release - marks.hold)
        release = Release(number, rounded_release(clip, cue, wanted))
        found += [cue, release]
        begin = end_of(clip, release.time) + PAUSE
    return found, begin
