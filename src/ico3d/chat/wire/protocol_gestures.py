"""Parts of messages about gestures of a body on a skeleton."""

from dataclasses import dataclass

from ico3d.chat.wire.marks import Count, Name, Seconds

MAX_CUES = 64  # in one message


@dataclass(frozen=True)
class Cue:
    """A gesture to make; times are seconds of the utterance.

    Attributes:
        number: Number of the cue in the utterance.
        name: Name of the gesture in the bundle.
        mirror: Whether to make the gesture with the other hand.
        begin: Time at which the gesture begins.
        stroke: Time at which the stroke arrives, which is that of an accent.
        skip: Seconds of the gesture's beginning to leave out.
    """

    number: Count
    name: Name
    mirror: bool
    begin: Seconds
    stroke: Seconds
    skip: Seconds


@dataclass(frozen=True)
class Release:
    """The end of a gesture that is being held.

    Attributes:
        number: Number of the gesture's cue.
        time: Time at which the hands begin to come down, in seconds of the utterance.
    """

    number: Count
    time: Seconds
