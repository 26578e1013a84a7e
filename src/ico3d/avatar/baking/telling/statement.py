"""What only people can say of an avatar."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Statement:
    """What only people can say of an avatar; the bundle carries it, and the page shows it.

    Attributes:
        likeness: Whose likeness the avatar is; by default what the recordings state.
        consent: What that person agreed to, and how: "agreed in writing on 2026-11-24 to …"; by
            default what the recordings state.
        licence: Licence under which the avatar may be used; by default that of the recordings.
        made_by: Who makes the avatar.
    """

    likeness: str = ""
    consent: str = ""
    licence: str = ""
    made_by: str = ""
