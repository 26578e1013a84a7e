"""The queue of visitors for whom a server has no place yet."""

import asyncio
import secrets
from collections import deque
from collections.abc import Callable, Collection

from ico3d.chat.bucket import Bucket
from ico3d.chat.serving.limits import RETURNS, RETURNS_AT_ONCE
from ico3d.chat.wire.protocol import RESUME_SECONDS

MOST_WAITING = 50  # visitors; each holds an open connection
SHARE = 0.5  # of the queue that the visitors of one machine may fill
REMEMBERED = 16  # ended sessions from which waiting times are estimated


class FullError(Exception):
    """The queue is full as well; the sentence is for the page."""


class ClosedError(Exception):
    """The server is about to end, and takes nobody any more."""


class Ticket:
    """The claim of one connection to a place in the queue.

    Attributes:
        id: Id by which a page comes back to its place; its session gets the same one.
        admitted: Whether a place is free for this visitor, and kept until the session begins.
        replaced: Whether another connection has claimed the same place.
        turned_away: Whether there will be no place, because the server is about to end.
        changed: Set when the queue has moved.
        machine: Machine of the visitor; empty if unknown.
        returns: How often the page may come back to its place.
    """

    def __init__(self, id: str, machine: str = "", returns: Bucket | None = None):
        """Waits with its page present; `returns` is that of the ticket of before, if any."""
        loop = asyncio.get_running_loop()
        self.returns = returns or Bucket(RETURNS, RETURNS_AT_ONCE, loop.time)
        self.id, self.machine = id, machine
        self.admitted = self.replaced = self.turned_away = False
        self.changed = asyncio.Event()
        self.expiry: asyncio.TimerHandle | None = None  # while its page is away


class WaitingLine:
    """Admits visitors in the order in which they came.

    A page whose connection drops keeps its place in the queue for a while. If its turn comes
    meanwhile, the first visitor behind it who is present goes first, and it remains at the front.
    """

    def __init__(
        self,
        free: Callable[[], int],
        most: int = MOST_WAITING,
        kept: float = RESUME_SECONDS,
        has_share: Callable[[str, int], bool] = lambda *_: True,
    ):
        """Starts empty.

        Args:
            free: Returns how many more sessions the server may open now.
            most: Largest number of waiting visitors.
            kept: Seconds for which a place is kept after the connection was lost.
            has_share: Whether a machine may have another place besides its sessions and the given
                number of places kept for it. Those behind its visitors go first until it may.
        """
        self._free, self._most, self._kept = free, most, kept
        self._has_share = has_share
        self._waiting: dict[str, Ticket] = {}  # in order
        self._admitted: set[Ticket] = set()
        self.is_closed = False

    def __len__(self) -> int:
        """How many are waiting, including those whose connection was lost a moment ago."""
        return len(self._waiting)

    def join(self, id: str | None, machine: str = "") -> Ticket:
        """Takes the place with this id again, or the last place of the queue.

        Args:
            id: Id of a ticket of before, if there was one.
            machine: Machine of the visitor; empty if unknown.

        Raises:
            FullError: If the queue has as many visitors as it may have, at all or of this machine.
            ClosedError: If the server is about to end.
        """
        if self.is_closed:
            raise ClosedError
        before = self._waiting.get(id or "")
        if before is None and self._is_full(machine) and not self._admits(machine):
            raise FullError
        if before is None:
            ticket = Ticket(secrets.token_urlsafe(16), machine)
        else:
            ticket = Ticket(before.id, machine, before.returns)
        self._waiting[ticket.id] = ticket  # an id that is known keeps its position
        if before is not None:
            self._cancel_expiry(before)
            before.replaced = True
            before.changed.set()
        self.move_up()
        return ticket

    def knows(self, id: str | None) -> bool:
        """Whether the place with this id is taken by somebody who waits."""
        return id in self._waiting

    def may_return(self, id: str | None) -> bool:
        """Counts a return to a place that `knows` knows; False if there were too many at once."""
        return self._waiting[id or ""].returns.take(1)

    def leave(self, ticket: Ticket, for_good: bool = True) -> None:
        """Gives a place up, or keeps it a while for a page that may come back.

        Tickets that were replaced or have left before are ignored.
        """
        if ticket in self._admitted:
            self._admitted.remove(ticket)
        elif self._waiting.get(ticket.id) is not ticket:
            return
        elif for_good:
            del self._waiting[ticket.id]
            self._cancel_expiry(ticket)
        elif ticket.expiry is None:
            loop = asyncio.get_running_loop()
            ticket.expiry = loop.call_later(self._kept, self.leave, ticket)
        self.move_up()

    def move_up(self) -> None:
        """Admits as many as there is room for, and tells all that the queue has moved."""
        for ticket in [t for t in self._waiting.values() if t.expiry is None]:
            if not self._admits(ticket.machine):
                continue
            del self._waiting[ticket.id]
            ticket.admitted = True
            self._admitted.add(ticket)
            ticket.changed.set()
        for ticket in self._waiting.values():
            ticket.changed.set()

    def close(self) -> None:
        """Admits nobody any more, and tells those who wait."""
        self.is_closed = True
        for ticket in self._waiting.values():
            ticket.turned_away = True
            ticket.changed.set()

    def position(self, ticket: Ticket) -> int:
        """Position of a waiting ticket; 1 is the front."""
        return list(self._waiting).index(ticket.id) + 1

    def _admits(self, machine: str) -> bool:
        """Whether there is a place for a visitor of this machine now."""
        kept = sum(ticket.machine == machine for ticket in self._admitted)
        return self._spare() > 0 and self._has_share(machine, kept)

    def _is_full(self, machine: str) -> bool:
        same = [ticket for ticket in self._waiting.values() if ticket.machine == machine != ""]
        return len(self._waiting) >= self._most or len(same) >= SHARE * self._most

    def _spare(self) -> int:
        return 0 if self.is_closed else max(0, self._free() - len(self._admitted))

    @staticmethod
    def _cancel_expiry(ticket: Ticket) -> None:
        if ticket.expiry is not None:
            ticket.expiry.cancel()
            ticket.expiry = None


class Stays:
    """How long visitors stay, for an estimate of how long others wait.

    The estimate assumes that each visitor leaves at a constant rate: the number of those who have
    left, divided by the time that they and the present visitors have spent here (the
    maximum-likelihood estimate of an exponential distribution with censored values). One long
    conversation therefore lengthens the estimate before it has ended.
    """

    def __init__(self):
        """Starts without knowledge."""
        self._ended: deque[float] = deque(maxlen=REMEMBERED)

    def end(self, seconds: float) -> None:
        """Notes how long a visitor stayed."""
        self._ended.append(seconds)

    def until_free(self, count: int, present: Collection[float]) -> float | None:
        """Expected seconds until `count` of the present visitors have left.

        Args:
            count: How many places have to become free.
            present: Seconds that each present visitor has been here.

        Returns:
            The estimate; None if nobody has left yet or nobody is present.
        """
        if not self._ended or not present:
            return None
        spent = sum(self._ended) + sum(present)
        return count * spent / (len(self._ended) * len(present))
