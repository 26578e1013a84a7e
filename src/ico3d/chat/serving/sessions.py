"""Sessions of visitors, which survive a lost connection for a while."""

import asyncio
import secrets
from collections.abc import Callable
from dataclasses import replace

from ico3d.chat.conversation import Conversation
from ico3d.chat.observing.monitor import Monitor, Visitor
from ico3d.chat.page import Outbox, Page
from ico3d.chat.parts import Avatar, Parts
from ico3d.chat.services.offers import wished
from ico3d.chat.serving.freeing import give_back
from ico3d.chat.wire.protocol import RESUME_SECONDS, Error, Hello, Offer
from ico3d.errors import ServiceError

IDLE = "Nothing was said for {:g} min, so this conversation has ended."
BROKEN_OFF = "The conversation broke off because of a fault in the server."
FULL = "all places are taken: try again in a minute."
LATE = "your place was kept for {:g} s and then given away, and all places are taken: " + (
    "try again in a minute."
)
STARTING = 30.0  # s that a conversation may take to start: a model may be loaded, a server asked


class FullError(Exception):
    """The server has as many visitors as it accepts; the sentence is for the page."""


class Session:
    """One visitor: a page and a conversation, separate from all others."""

    def __init__(self, avatar: Avatar, visitor: Visitor, ended: Callable[["Session"], None]):
        """Creates a session; `ended` is called if its conversation breaks off."""
        self.id = secrets.token_urlsafe(16)
        self.page = Page()
        seed = secrets.randbits(32)  # no two visitors see the same blinks and gestures
        self.conversation = Conversation(avatar, self.page, visitor, lambda: ended(self), seed)
        self.parts: Parts | None = None  # once it has started
        self.expiry: asyncio.TimerHandle | None = None  # while its page is away
        self.idle_check: asyncio.TimerHandle | None = None


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

    def __len__(self) -> int:
        """Visitors at this moment, those included that may come back."""
        return len(self._open)

    async def enter(self, hello: Hello, outbox: Outbox) -> tuple[Session, bool]:
        """Resumes a session or opens a new one; `outbox` receives its messages.

        Returns:
            The session, and whether it was resumed.

        Raises:
            FullError: If there is no room; sessions whose page is away count, too.
            Ico3dError: If the conversation does not start, or not in time.
        """
        session = self._open.get(hello.session or "")
        if session is not None and session.parts is not None:
            self._cancel_expiry(session)
            session.page.attach(outbox)
            session.page.replay(hello.last_index)  # before anything new can get in between
            session.conversation.release()
            return session, True
        if len(self._open) >= self._avatar.settings.max_sessions:
            raise FullError(LATE.format(self._resume_seconds) if hello.session else FULL)
        return await self._begin(hello, outbox), False

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

    async def close_all(self) -> None:
        """Ends all sessions."""
        for session in list(self._open.values()):
            self._close_soon(session, "server")
        await asyncio.gather(*self._closing, return_exceptions=True)

    def _wished(self, hello: Hello) -> Avatar:
        avatar = self._avatar
        voices = avatar.persona.voice
        services = wished(avatar.services, avatar.settings, voices, hello.wishes, self.offers)
        return replace(avatar, services=services)

    async def _begin(self, hello: Hello, outbox: Outbox) -> Session:
        session = Session(self._wished(hello), self.monitor.visitor(), self._broke_off)
        self._open[session.id] = session
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
        return session

    def _broke_off(self, session: Session) -> None:
        """Ends a session whose pipeline ended by itself: no question would be answered."""
        self.monitor.failed("pipeline", "it ended by itself, and the conversation with it")
        session.page.end(Error(BROKEN_OFF, fatal=True, again=True))
        self._close_soon(session, "broken")

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
        session.page.end(Error(IDLE.format(minutes), fatal=True, again=True))
        self._close_soon(session, "idle")

    def _close_soon(self, session: Session, why: str) -> None:
        if self._open.pop(session.id, None) is None:
            return
        self.monitor.left(why)
        self._cancel_expiry(session)
        if session.idle_check is not None:
            session.idle_check.cancel()
        task = asyncio.create_task(dismantle(session.conversation))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    @staticmethod
    def _cancel_expiry(session: Session) -> None:
        if session.expiry is not None:
            session.expiry.cancel()
            session.expiry = None


async def dismantle(conversation: Conversation) -> None:
    """Ends a conversation and frees the memory."""
    await conversation.close()
    del conversation
    await give_back()
