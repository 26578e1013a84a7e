"""What messages say of gestures on a skeleton."""

from dataclasses import dataclass

from ico3d.chat.wire.marks import Count, Name, Seconds

MAX_CUES = 64  # in one message


@dataclass(frozen=True)
class Cue:
    """A gesture to make; times are the utterance's.

    Attributes:
        number: Counts the cues of the utterance.
        name: Of the gesture in the bundle.
        mirror: Whether with the other hand.
        begin: When it begins.
        stroke: When its stroke arrives: on an accent.
        skip: Seconds of the gesture's beginning that are left out.
    """

    number: Count
    name: Name
    mirror: bool
    begin: Seconds
    stroke: Seconds
    skip: Seconds


@dataclass(frozen=True)
class Release:
    """A gesture that is held is let go.

    Attributes:
        number: Of its cue.
        time: When hands begin to come down, on the utterance's time.
    """

    number: Count
    time: Seconds
