"""The bundle's file with the gestures and the figure of a body on a skeleton."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.hanging_arms import hung_beside
from ico3d.bundle.skinned.posing import recorded_rotations
from ico3d.errors import BundleError, SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.motion.person import Person
from ico3d.motion.recorded.cut import REST, Cut, from_toml, to_toml
from ico3d.motion.recorded.cutting import find_cuts
from ico3d.motion.recorded.making import hung_in, recorded_clips
from ico3d.motion.recorded.recording import Recording, recording_of
from ico3d.motion.repertoire import clips_for, cuts_text, hung_of, preferring, repertoire_bytes
from ico3d.rig.quaternions import Array

GESTURES = "body/gestures.safetensors"
"""Name of the file. A body whose rig lacks a person's roles has none, and cannot gesture."""


def gesture_files(
    baked: BakedSkinned, cuts: Sequence[Cut] | None = None, width: float | None = None
) -> dict[str, bytes]:
    """Makes the file of gestures: recorded ones, and the package's where none was recorded.

    Args:
        baked: The body, as the bundle holds it.
        cuts: Gestures in the recording; None finds them by rule.
        width: How many times as wide as the recorded one the trunk is. Where that is told, arms
            hang as near to the body as it allows, and not as they hung in the recording.

    Returns:
        Content of the file by its name; empty where the rig lacks a person's roles.
    """
    recording = recording_in(baked)
    if recording is None:
        return {}
    info, cuts = baked.info, find_cuts(recording) if cuts is None else cuts
    if width is not None:
        recording = replace(recording, person=_widened(recording.person, width))
        cuts = [cut for cut in cuts if cut.name != REST]
    rests = any(cut.name == REST for cut in cuts)
    hung = hung_in(recording, cuts) if rests else hung_beside(baked, recording.person)
    somebody = living(baked.rig, 0, hung)
    others = library(recording.person, hung=somebody.hung)
    clips = preferring(recorded_clips(recording, cuts), others)
    text = to_toml(cuts, info.fps, info.num_frames)
    return {GESTURES: repertoire_bytes(somebody, clips, text)}


def _widened(person: Person, width: float) -> Person:
    """A person with a trunk that is so many times as wide."""
    wide, deep = person.thickness.torso
    return replace(person, thickness=replace(person.thickness, torso=(width * wide, width * deep)))


def recording_in(baked: BakedSkinned) -> Recording | None:
    """The recorded motion of a body; None where its rig lacks a person's roles."""
    try:
        return recording_of(baked.rig, baked.info.fps, recorded_rotations(baked))
    except SettingsError:
        return None


@dataclass(frozen=True, eq=False)
class Repertoire:
    """Content of a file of gestures.

    Attributes:
        clips: Gestures by name.
        cuts: Frames of the recording from which recorded gestures were made.
        hung: (R, 4) pose by role with hanging arms.
    """

    clips: dict[str, Clip]
    cuts: tuple[Cut, ...]
    hung: Array


def gestures_from(data: bytes, baked: BakedSkinned) -> Repertoire:
    """Reads a file of gestures.

    Args:
        data: Content of the file.
        baked: The body that the file must belong to.

    Raises:
        BundleError: If the file is damaged, or belongs to another body.
    """
    info = baked.info
    try:
        clips, text = clips_for(data, baked.rig), cuts_text(data)
        about = "the list of clips", info.fps, info.num_frames
        cuts = from_toml(text.encode(), *about) if text else ()
    except SettingsError as error:
        raise BundleError(f"{GESTURES}: {error}") from error
    return Repertoire(clips, cuts, hung_of(data))
