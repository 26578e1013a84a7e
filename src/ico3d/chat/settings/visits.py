"""Settings of how much visitors may take of a server."""

import math
from dataclasses import dataclass

from ico3d.errors import SettingsError

SHORTEST_ANSWER = 200  # letters


@dataclass(frozen=True)
class Visits:
    """How much visitors may take: the table `[limits]`.

    Attributes:
        session_minutes: Longest duration of a session; 0 for any.
        questions_per_minute: Questions that a visitor may ask, spoken or typed, on average and at
            once; an answer that is prepared in a pause and thrown away counts, too. A visitor who
            has asked so many is not heard until a later one is allowed.
        answer_letters: Longest answer; a longer one is cut off.
        sessions_per_address: Sessions of one address (IPv4 address, or IPv6 network of 64 bits) at
            the same time, of the `max_sessions` of all; 0 for half of them. Visitors on this
            machine are not limited.
    """

    session_minutes: float = 60.0
    questions_per_minute: float = 30.0
    answer_letters: int = 4000
    sessions_per_address: int = 0

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If nobody could talk.
        """
        if not 0 <= self.session_minutes < math.inf:
            raise SettingsError("chat settings: [limits] session_minutes must be 0 (any) or more.")
        if not 1 <= self.questions_per_minute < math.inf:
            raise SettingsError("chat settings: [limits] questions_per_minute must be 1 or more.")
        if self.answer_letters < SHORTEST_ANSWER:
            raise SettingsError(
                f"chat settings: [limits] answer_letters must be {SHORTEST_ANSWER} or more."
            )
        if self.sessions_per_address < 0:
            raise SettingsError(
                "chat settings: [limits] sessions_per_address must be 0 (half) or more."
            )

    def share(self, max_sessions: int) -> int:
        """Sessions of one address at the same time, of `max_sessions` of all."""
        return self.sessions_per_address or (max_sessions + 1) // 2
