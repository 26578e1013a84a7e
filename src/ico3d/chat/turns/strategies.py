"""Strategies of beginnings and ends of turns, in pipecat's form."""

import time
from collections.abc import Callable

from pipecat.turns.user_turn_strategies import UserTurnStrategies

from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.eager import EagerSmartTurn
from ico3d.chat.turns.floor import Floor
from ico3d.chat.turns.phrases import phrases
from ico3d.chat.turns.start import FloorTurnStart
from ico3d.chat.turns.stop import ReleaseTurnStop, SpeculativeTurnStop


def strategies(
    analyzer: EagerSmartTurn,
    settings: Turns,
    trusted: bool,
    hush: Callable[[bool], None],
    now: Callable[[], float] = time.monotonic,
) -> UserTurnStrategies:
    """The strategies of one session.

    Args:
        analyzer: Judges whether a pause ends a turn.
        settings: Durations that decide on turns.
        trusted: Whether the recogniser understands short words reliably.
        hush: Pauses the avatar's speech (True) or resumes it (False).
        now: Returns the time in seconds.
    """
    floor = Floor(settings, phrases(), trusted, now)
    return UserTurnStrategies(
        start=[FloorTurnStart(floor, hush)],
        stop=[
            ReleaseTurnStop(),
            SpeculativeTurnStop(settings.speculate, analyzer),
        ],
    )
