"""Sessions of visitors, which survive a lost connection for a while."""

import asyncio
import secrets
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from ico3d.chat.bucket import Bucket
from ico3d.chat.conversation import Conversation
from ico3d.chat.observing.metrics import Monitor, Visitor
from ico3d.chat.page import Outbox, Page
from ico3d.chat.parts import Avatar, Parts
from ico3d.chat.services.offers import wished
from ico3d.chat.serving.crowd import Meters
from ico3d.chat.serving.freeing import give_back
from ico3d.chat.serving.limits import Backlogs, Inlet, SessionLimits
from ico3d.chat.serving.waiting import Stays, Ticket, WaitingLine
from ico3d.chat.supervision.allowance import Allowance
from ico3d.chat.wire.protocol import RESUME_SECONDS, Hello, Offer, Place
from ico3d.chat.wire.sentences import ENDING, FAULT, IDLE, LONG
from ico3d.errors import ServiceError

STARTS, STARTS_AT_ONCE = 0.1, 5  # a second for long and at once, per place that a machine may have
STARTING = 30.0  # s that a conversation may take to start: a model may be loaded, a server asked


class HastyError(Exception):
    """A machine has begun more conversations than it may in a short time."""


class RestlessError(Exception):
    """A page comes back more often than broken lines explain."""


class Session:
    """One visitor: a page and a conversation, separate from all others."""

    def __init__(
        self,
        ticket: Ticket,
        avatar: Avatar,
        visitor: Visitor,
        ended: Callable[["Session"], None],
        allowance: Allowance,
    ):
        """Creates a session.

        Args:
            ticket: Claim to the place that the session takes.
            avatar: What all sessions share.
            visitor: Counts events for the operator's figures.
            ended: Called if the conversation breaks off.
            allowance: How much the visitor may ask.
        """
        self.id, self.machine = ticket.id, ticket.machine
        self.began = _now()
        self.limits, self.inlet = SessionLimits(_now), Inlet(_now)
        self.page = Page()
        seed = secrets.randbits(32)  # no two visitors see the same blinks and gestures
        self.conversation = Conversation(
            avatar, self.page, visitor, lambda: ended(self), seed, allowance
        )
        self.parts: Parts | None = None  # once it has started
        self.expiry: asyncio.TimerHandle | None = None  # while its page is away
        self.idle_check: asyncio.TimerHandle | None = None
        self.limit: asyncio.TimerHandle | None = None  # ends it when it has lasted long enough


class Sessions:
    """Opens, resumes and closes sessions."""

    def __init__(
        self,
        avatar: Avatar,
        resume_seconds: float = RESUME_SECONDS,
        monitor: Monitor | None = None,
        starting: float = STARTING,
    ):
        """Starts without visitors.

        Args:
            avatar: What all sessions share.
            resume_seconds: Seconds for which a session is kept after its connection was lost.
            monitor: Counts visitors and errors.
            starting: Time limit in seconds for the start of a conversation.
        """
        self.offers: list[Offer] = []
        """What visitors may choose from."""
        self.at_home = False
        """Whether visitors may know what is wrong with the server: it is their own machine."""
        self._avatar = avatar
        self._resume_seconds, self._starting = resume_seconds, starting
        self.monitor = monitor or Monitor()
        self._open: dict[str, Session] = {}
        self._closing: set[asyncio.Task] = set()
        self.line = WaitingLine(self._free, kept=resume_seconds, has_share=self._has_share)
        """Visitors for whom there is no place yet."""
        self.monitor.waiting.set_function(lambda: len(self.line))
        self._stays = Stays()
        limits = avatar.settings.limits
        self._share = share = limits.share(avatar.settings.max_sessions)
        asked = share * limits.questions_per_minute
        self._starts = Meters(share * STARTS, share * STARTS_AT_ONCE, _now)
        self._questions = Meters(asked / 60, asked, _now)

    @cached_property
    def backlogs(self) -> Backlogs:
        """What networks have held back, of all sessions."""
        return Backlogs(_now)

    def __len__(self) -> int:
        """Visitors at this moment, those included that may come back."""
        return len(self._open)

    def line_up(self, hello: Hello, machine: str = "") -> Ticket | None:
        """Puts a page in the queue, which it passes at once while there are places.

        Args:
            hello: The page's first message.
            machine: Machine of the visitor; empty if unknown.

        Returns:
            Its ticket; None if the page has a session, which needs no new place.

        Raises:
            FullError: If the queue is full; sessions whose page is away count as taken places.
            HastyError: If the machine has begun too many conversations in a short time.
            ClosedError: If the server is about to end.
            RestlessError: If the page has come back to its session, or to its place in the queue,
                too often in a short time.
        """
        if self._resumable(hello):
            if not self._open[hello.session or ""].limits.come_back():
                raise RestlessError
            return None
        if self.line.knows(hello.session):
            if not self.line.may_return(hello.session):
                raise RestlessError
        elif not self._starts.take(machine):
            raise HastyError
        return self.line.join(hello.session, machine)

    def place(self, ticket: Ticket) -> Place:
        """What a waiting page is told."""
        now = asyncio.get_running_loop().time()
        position = self.line.position(ticket)
        stays = [now - session.began for session in self._open.values()]
        return Place(ticket.id, position, self._stays.until_free(position, stays))

    async def enter(
        self, hello: Hello, outbox: Outbox, ticket: Ticket | None
    ) -> tuple[Session, bool]:
        """Resumes a session or, with an admitted ticket, opens a new one.

        Args:
            hello: The page's first message.
            outbox: Receives the messages of the session.
            ticket: What `line_up` returned.

        Returns:
            The session, and whether it was resumed.

        Raises:
            Ico3dError: If the conversation does not start, or not in time.
        """
        if ticket is None:
            session = self._open[hello.session or ""]
            self._cancel_expiry(session)
            session.page.attach(outbox)
            session.page.replay(hello.last_index)  # before anything new can get in between
            session.conversation.release()
            return session, True
        try:
            return await self._begin(hello, outbox, ticket), False
        finally:
            self.line.leave(ticket)  # if it did not even begin

    def leave(self, session: Session, outbox: Outbox, for_good: bool = False) -> None:
        """Handles a closed connection: ends the session if `for_good`, else keeps it a while."""
        if session.id not in self._open or not session.page.detach(outbox):
            return
        if for_good:
            self._close_soon(session, "left")
            return
        session.conversation.hold()
        loop = asyncio.get_running_loop()
        session.expiry = loop.call_later(self._resume_seconds, self._close_soon, session, "left")

    def present(self) -> list[Session]:
        """All sessions, those included whose page may come back."""
        return list(self._open.values())

    def dismiss(self, session: Session) -> None:
        """Ends a session because the server ends, and tells its page."""
        session.page.end(ENDING.error(fatal=True, again=True))
        self._close_soon(session, "server")

    async def close_all(self) -> None:
        """Ends all sessions."""
        for session in self.present():
            self._close_soon(session, "server")
        await asyncio.gather(*self._closing, return_exceptions=True)

    def _resumable(self, hello: Hello) -> bool:
        session = self._open.get(hello.session or "")
        return session is not None and session.parts is not None

    def _free(self) -> int:
        return self._avatar.settings.max_sessions - len(self._open)

    def _has_share(self, machine: str, kept: int) -> bool:
        """Whether a machine has room for another session besides `kept` places."""
        held = sum(session.machine == machine for session in self._open.values())
        return machine == "" or held + kept < self._share

    def _allowance(self, machine: str) -> Allowance:
        """What a new visitor may ask: nobody gets more by beginning anew."""
        asked = self._avatar.settings.limits.questions_per_minute
        return Allowance(Bucket(asked / 60, asked, _now), *self._questions.of(machine))

    def _wished(self, hello: Hello) -> Avatar:
        avatar = self._avatar
        voices, own = avatar.persona.voice, avatar.own_voice
        wishes = hello.wishes, self.offers
        services = wished(avatar.services, avatar.settings, voices, *wishes, own)
        return replace(avatar, services=services)

    async def _begin(self, hello: Hello, outbox: Outbox, ticket: Ticket) -> Session:
        avatar = self._wished(hello)
        allowance = self._allowance(ticket.machine)
        session = Session(ticket, avatar, self.monitor.visitor(), self._broke_off, allowance)
        self._open[session.id] = session
        self.line.leave(ticket)  # the session has the place that was kept for the ticket
        session.page.attach(outbox)
        try:
            async with asyncio.timeout(self._starting):
                session.parts = await session.conversation.start()
        except BaseException as error:
            self._close_soon(session, "error")
            if isinstance(error, TimeoutError):
                raise ServiceError(
                    f"the services of the conversation were not ready within {self._starting:g} s."
                ) from error
            raise
        self._check_idle(session)
        if minutes := avatar.settings.limits.session_minutes:
            loop = asyncio.get_running_loop()
            session.limit = loop.call_later(60 * minutes, self._outlast, session, minutes)
        return session

    def _broke_off(self, session: Session) -> None:
        """Ends a session whose pipeline ended by itself: no question would be answered."""
        self.monitor.failed("pipeline", "it ended by itself, and the conversation with it")
        session.page.end(FAULT.error(fatal=True, again=True))
        self._close_soon(session, "broken")

    def _outlast(self, session: Session, minutes: float) -> None:
        """Ends a session that has lasted as long as one may."""
        session.page.end(LONG.error(fatal=True, again=True, minutes=minutes))
        self._close_soon(session, "long")

    def _check_idle(self, session: Session) -> None:
        """Ends a session in which nothing happens; looks again when that may be so."""
        minutes = self._avatar.settings.idle_minutes
        if minutes == 0 or session.id not in self._open:
            return
        left = 60 * minutes - session.conversation.activity.idle_seconds()
        if left > 0:
            loop = asyncio.get_running_loop()
            session.idle_check = loop.call_later(left, self._check_idle, session)
            return
        session.page.end(IDLE.error(fatal=True, again=True, minutes=minutes))
        self._close_soon(session, "idle")

    def _close_soon(self, session: Session, why: str) -> None:
        if self._open.pop(session.id, None) is None:
            return
        self.monitor.left(why)
        self._stays.end(asyncio.get_running_loop().time() - session.began)
        self.line.move_up()
        self._cancel_expiry(session)
        for timer in (session.idle_check, session.limit):
            if timer is not None:
                timer.cancel()
        task = asyncio.create_task(dismantle(session.conversation))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    @staticmethod
    def _cancel_expiry(session: Session) -> None:
        if session.expiry is not None:
            session.expiry.cancel()
            session.expiry = None


def _now() -> float:
    return asyncio.get_running_loop().time()


async def dismantle(conversation: Conversation) -> None:
    """Ends a conversation and frees the memory."""
    await conversation.close()
    del conversation
    await give_back()
