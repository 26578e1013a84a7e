"""How turns begin and end, as pipecat takes it."""

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
        analyzer: Hears whether a pause ends a turn.
        settings: Who speaks when.
        trusted: Whether the recogniser hears short words rightly.
        hush: Pauses what the avatar says (True) or goes on with it (False).
        now: The clock, seconds.
    """
    floor = Floor(settings, phrases(), trusted, now)
    return UserTurnStrategies(
        start=[FloorTurnStart(floor, hush)],
        stop=[
            ReleaseTurnStop(),
            SpeculativeTurnStop(settings.speculate, analyzer),
        ],
    )
