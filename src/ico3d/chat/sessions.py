"""Who talks with the avatar: sessions that outlive a dropped connection for a while."""

import asyncio
import secrets
from dataclasses import replace

from ico3d.chat.conversation import Avatar, Conversation
from ico3d.chat.freeing import give_back
from ico3d.chat.monitor import Monitor, Visitor
from ico3d.chat.page import Outbox, Page
from ico3d.chat.protocol import RESUME_SECONDS, Error, Hello, Offer
from ico3d.chat.services.offers import wished

IDLE = "Nothing was said for {:g} min, so this conversation has ended."


class FullError(Exception):
    """There are as many visitors as the server takes."""


class Session:
    """One visitor: a page, a conversation, and nothing that another one could see."""

    def __init__(self, avatar: Avatar, visitor: Visitor):
        """A session whose conversation has not started."""
        self.id = secrets.token_urlsafe(16)
        self.services = avatar.services
        self.page = Page()
        self.conversation = Conversation(avatar, self.page, visitor)
        self.expiry: asyncio.TimerHandle | None = None  # while its page is away
        self.idle_check: asyncio.TimerHandle | None = None


class Sessions:
    """Opens, keeps and closes sessions."""

    def __init__(
        self,
        avatar: Avatar,
        resume_seconds: float = RESUME_SECONDS,
        monitor: Monitor | None = None,
    ):
        """No visitors yet; `monitor` counts them."""
        self.offers: list[Offer] = []
        """What visitors may choose from."""
        self._avatar = avatar
        self._resume_seconds = resume_seconds
        self.monitor = monitor or Monitor()
        self._open: dict[str, Session] = {}
        self._closing: set[asyncio.Task] = set()

    def __len__(self) -> int:
        """Visitors at this moment, those included that may come back."""
        return len(self._open)

    async def enter(self, hello: Hello, outbox: Outbox) -> tuple[Session, bool]:
        """The session that a page goes on with, or a new one; its messages go to `outbox`.

        Returns:
            The session and whether it is an old one.

        Raises:
            FullError: If there is no room.
        """
        session = self._open.get(hello.session or "")
        if session is not None:
            self._cancel_expiry(session)
            session.page.attach(outbox)
            session.page.replay(hello.last_index)  # before anything new can get in between
            session.conversation.release()
            return session, True
        self._make_room()
        session = Session(self._wished(hello), self.monitor.visitor())
        self._open[session.id] = session
        session.page.attach(outbox)
        try:
            await session.conversation.start()
        except BaseException:
            del self._open[session.id]
            self.monitor.left("error")
            raise
        self._check_idle(session)
        return session, False

    def leave(self, session: Session, outbox: Outbox) -> None:
        """A connection closed; its session waits for the page to come back."""
        if session.id in self._open and session.page.detach(outbox):
            session.conversation.hold()
            loop = asyncio.get_running_loop()
            session.expiry = loop.call_later(
                self._resume_seconds, self._close_soon, session, "left"
            )

    async def close_all(self) -> None:
        """Ends every conversation."""
        for session in list(self._open.values()):
            self._close_soon(session, "server")
        await asyncio.gather(*self._closing, return_exceptions=True)

    def _wished(self, hello: Hello) -> Avatar:
        avatar = self._avatar
        voices = avatar.persona.voice
        services = wished(avatar.services, avatar.settings, voices, hello.wishes, self.offers)
        return replace(avatar, services=services)

    def _make_room(self) -> None:
        if len(self._open) < self._avatar.settings.max_sessions:
            return
        for session in self._open.values():
            if not session.page.is_attached:
                self._close_soon(session, "room")
                return
        raise FullError

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
    """Ends a conversation and frees its memory."""
    await conversation.close()
    del conversation
    await give_back()
