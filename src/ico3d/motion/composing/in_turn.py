"""Directions to make given gestures one after the other."""

from collections.abc import Mapping, Sequence

from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.composing.cues import Cue, Direction, Release, end_of, rounded_release

BEGIN = 0.6
"""Seconds before the first gesture."""
PAUSE = 0.5
"""Seconds between two gestures, in which hands hang."""
HELD = 2
"""Number of holds of its clip for which each gesture is held or repeated."""


def in_turn(clips: Mapping[str, Clip], names: Sequence[str]) -> tuple[list[Direction], float]:
    """Directions to make gestures one after the other, each at the pace of its clip.

    Args:
        clips: Clips by name.
        names: Names of the gestures in order; a name may occur again.

    Returns:
        Cues and releases, and the time in seconds at which hands hang again.

    Raises:
        SettingsError: If a name is not among the clips.
    """
    found: list[Direction] = []
    begin = BEGIN
    for number, name in enumerate(names):
        if name not in clips:
            others = ", ".join(clips) or "none"
            raise SettingsError(f"there is no gesture '{name}': there are {others}.")
        clip = clips[name]
        marks = clip.marks
        cue = Cue(number, name, False, begin, begin + marks.stroke)
        wanted = cue.stroke + HELD * (marks.release - marks.hold)
        release = Release(number, rounded_release(clip, cue, wanted))
        found += [cue, release]
        begin = end_of(clip, release.time) + PAUSE
    return found, begin
