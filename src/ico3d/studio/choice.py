"""Loads the person to record, by name or from a file."""

from collections.abc import Sequence
from pathlib import Path

from ico3d.errors import SettingsError
from ico3d.studio.dress.draping import draped
from ico3d.studio.person.anny_person import load_anny
from ico3d.studio.person.growing.grow import with_hair
from ico3d.studio.person.npz_person import load_npz
from ico3d.studio.person.subject import Subject
from ico3d.studio.person.traits.given import with_traits
from ico3d.studio.person.traits.names import TraitName


def load_subject(subject: str, whole: bool = False, traits: Sequence[TraitName] = ()) -> Subject:
    """Loads a person.

    Args:
        subject: `anny`, or the path of an `.npz` file in the layout of docs/captures/synthetic.md,
            "Subject files".
        whole: True for the whole person with a skeleton, False for a bust.
        traits: What the person has, of `TRAITS`.

    Raises:
        CaptureError: If the file is missing, or is not in that layout.
        MissingExtraError: If `anny` is asked for and not installed.
        SettingsError: If somebody else than `anny` is to be a child.
    """
    if subject == "anny":
        person = load_anny(whole, "child" in traits)
    elif "child" in traits:
        raise SettingsError("only the subject 'anny' can be a child.")
    else:
        person = load_npz(Path(subject), whole)
    if whole:
        person = draped(person)
    return with_traits(with_hair(person, "long-hair" in traits), traits)
