"""Limits of a module's requests."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits of a module's requests.

    Attributes:
        requests: Requests at a time; further ones are answered with 429.
        megabytes: Size of a request; larger ones are answered with 413.
        seconds: Duration of a request; longer ones are answered with 504, or cut off.
    """

    requests: int = 8
    megabytes: float = 25.0
    seconds: float = 120.0
