"""Whom the studio can record."""

from pathlib import Path

from ico3d.errors import SettingsError
from ico3d.studio.person.anny_person import load_anny
from ico3d.studio.person.npz_person import load_npz
from ico3d.studio.person.subject import Subject


def load_subject(subject: str, whole: bool = False) -> Subject:
    """Loads a person.

    Args:
        subject: `anny`, or the path of an `.npz` file in the layout of `subject_npz`.
        whole: The whole person with a skeleton; otherwise a bust.

    Raises:
        SettingsError: If `anny` is to be whole.
        CaptureError: If there is no such file or it is not in that layout.
        MissingExtraError: If `anny` is asked for and not installed.
    """
    if subject == "anny" and whole:
        raise SettingsError("anny is a bust: name an .npz file to record a whole person.")
    if subject == "anny":
        return load_anny()
    return load_npz(Path(subject), whole)
