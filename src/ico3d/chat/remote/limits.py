"""How much a module takes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """How much a module takes.

    Attributes:
        requests: At once; further ones are answered with 429.
        megabytes: Of one request; larger ones are answered with 413.
        seconds: That one request may take; then it is answered with 504, or cut off.
    """

    requests: int = 8
    megabytes: float = 25.0
    seconds: float = 120.0
