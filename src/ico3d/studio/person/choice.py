"""Loads the person to record, by name or from a file."""

from pathlib import Path

from ico3d.studio.person.anny_person import load_anny
from ico3d.studio.person.growing.grow import with_hair
from ico3d.studio.person.npz_person import load_npz
from ico3d.studio.person.subject import Subject


def load_subject(subject: str, whole: bool = False) -> Subject:
    """Loads a person.

    Args:
        subject: `anny`, or the path of an `.npz` file in the layout of docs/captures/synthetic.md,
            "Subject files".
        whole: True for the whole person with a skeleton, False for a bust.

    Raises:
        CaptureError: If the file is missing, or is not in that layout.
        MissingExtraError: If `anny` is asked for and not installed.
    """
    if subject == "anny":
        return with_hair(load_anny(whole))
    return with_hair(load_npz(Path(subject), whole))
