"""Which statements about a recorded person were made: whose likeness, consent, licence."""

NOT_STATED = "not stated"
NOBODY = "nobody: no such person exists"
"""Whose likeness a synthetic person is."""
BETWEEN = "; "
"""Joins what several recordings of one person state."""


def is_stated(text: str) -> bool:
    """Whether something was said; of several recordings, of each of them."""
    return all(part.strip() not in ("", NOT_STATED) for part in text.split(BETWEEN))
