"""The gestures of a body on a skeleton, and its figure, as a file of the bundle."""

from ico3d.errors import BundleError, SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.motion.repertoire import clips_for, repertoire_bytes
from ico3d.rig.rig import Rig

GESTURES = "body/gestures.safetensors"
"""The file; a body whose rig lacks roles has none, and repeats what was recorded."""


def gesture_files(rig: Rig) -> dict[str, bytes]:
    """The file for a rig, whose joints are as the bundle holds them; none where it lacks roles."""
    try:
        somebody = living(rig, 0)
    except SettingsError:
        return {}
    return {GESTURES: repertoire_bytes(somebody, library(somebody.person))}


def gestures_from(data: bytes, rig: Rig) -> dict[str, Clip]:
    """The gestures in a file, by name.

    Raises:
        BundleError: If the file is damaged, or not of this rig.
    """
    try:
        return clips_for(data, rig)
    except SettingsError as error:
        raise BundleError(f"{GESTURES}: {error}") from error
