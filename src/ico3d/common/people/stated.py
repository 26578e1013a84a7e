"""Which statements about a recorded person were made: whose likeness, consent, licence."""

from ico3d.common.people.spelling import spelled

NOT_STATED = "not stated"
NOBODY = "nobody: no such person exists"
"""Whose likeness a synthetic person is."""
BETWEEN = "; "
"""Joins what several recordings of one person state."""


def is_stated(text: str) -> bool:
    """Whether something was said; of several recordings, of each of them."""
    return all(part.strip() not in ("", NOT_STATED) for part in text.split(BETWEEN))


def alike(name: str) -> str:
    """A name as names are compared: in whichever case and form of Unicode they are written."""
    return spelled("NFC", spelled("NFC", name).casefold())
