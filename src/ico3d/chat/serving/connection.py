"""One WebSocket connection, from `hello` to its end."""

import asyncio
import contextlib
from asyncio import FIRST_COMPLETED

from fastapi import WebSocket, WebSocketDisconnect
from loguru import logger

from ico3d.chat.observing.failures import cause
from ico3d.chat.page import Outbox
from ico3d.chat.serving.crowd import machine_of
from ico3d.chat.serving.sessions import HastyError, RestlessError, Session, Sessions
from ico3d.chat.serving.waiting import ClosedError, FullError, Ticket
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import OversizedError, decode_client, encode
from ico3d.chat.wire.protocol import (
    BEAT_SECONDS,
    Ack,
    Beat,
    ClientMessage,
    Error,
    Hello,
    Notice,
    ServerMessage,
    Welcome,
)
from ico3d.chat.wire.sentences import (
    CROWDED,
    ELSEWHERE,
    ENDING,
    FAULT,
    FULL,
    OUTDATED,
    UNREADY,
    Sentence,
)
from ico3d.errors import Ico3dError, ProtocolError

HELLO_SECONDS = 10  # that a page may take to say hello
GOING, BROKEN, TOO_BIG, FAILED, BUSY = 1000, 1008, 1009, 1011, 1013  # WebSocket close codes
GONE = (1000, 1001)  # what pages send that will not come back: the visitor left, or loads it anew
REFRESH = 15.0  # s after which a waiting page is told a new estimate


class Hangup(Exception):
    """Raised to close the connection with an error."""

    def __init__(self, code: int, sentence: Sentence | str, again: bool = False, **values: float):
        """Takes a close code, a sentence for the page, and whether a new session may succeed.

        Sentences without a code are for whoever writes a page; `values` are numbers of one with it.
        """
        known = isinstance(sentence, Sentence)
        self.told = sentence.error(True, again, **values) if known else Error(sentence, True, again)
        super().__init__(self.told.message)
        self.code = code


class Connection:
    """Reads the messages of a page and writes those of its session."""

    def __init__(self, socket: WebSocket, sessions: Sessions, notices: list[Notice]):
        """A connection.

        Args:
            socket: An accepted WebSocket.
            sessions: Provides the session.
            notices: Sentences about the avatar that every page shows.
        """
        self._socket, self._sessions, self._notices = socket, sessions, notices
        self._outbox = Outbox()

    async def run(self) -> None:
        """Exchanges messages until either side ends the connection."""
        with self._sessions.monitor.connections.track_inprogress():
            await self._run()

    async def _run(self) -> None:
        writer: asyncio.Task | None = None
        session: Session | None = None
        for_good = True
        try:
            hello = await self._hello()
            session, resumed = await self._enter(hello)
            await self._greet(session, resumed)
            writer = asyncio.create_task(self._write())
            await self._read(session)
        except Hangup as hangup:
            await self._hang_up(hangup)
        except RestlessError:
            self._sessions.monitor.failed("restless")
            await self._close(BUSY)  # without a last word: the page tries again, a little later
        except WebSocketDisconnect as disconnect:
            for_good = disconnect.code in GONE and not self._outbox.is_closed
        except Exception as error:
            await self._break_off(error)
        finally:
            self._outbox.close()
            if writer is not None:
                writer.cancel()
                await asyncio.gather(writer, return_exceptions=True)
            if session is not None:
                self._sessions.leave(session, self._outbox, for_good)

    async def _enter(self, hello: Hello) -> tuple[Session, bool]:
        """The page's session, or a sentence on why there is none."""
        ticket = await self._admission(hello)
        try:
            return await self._sessions.enter(hello, self._outbox, ticket)
        except Exception as error:
            own = isinstance(error, Ico3dError)
            self._sessions.monitor.failed("start", str(error) if own else cause(error))
            told = str(error) if own and self._sessions.at_home else UNREADY
            raise Hangup(FAILED, told, again=True) from error

    async def _admission(self, hello: Hello) -> Ticket | None:
        """Waits in the queue until there is a place; the ticket is None for a resumed session."""
        try:
            ticket = self._sessions.line_up(hello, machine_of(self._socket.scope.get("client")))
        except FullError as error:
            self._sessions.monitor.failed("full")
            raise Hangup(BUSY, FULL, again=True) from error
        except HastyError as error:
            self._sessions.monitor.failed("hasty")
            raise Hangup(BUSY, CROWDED, again=True) from error
        except ClosedError as error:
            raise Hangup(BUSY, ENDING, again=True) from error
        if ticket is None:
            return None
        try:
            await self._wait(ticket)
        except BaseException as error:
            left = isinstance(error, WebSocketDisconnect) and error.code in GONE
            self._sessions.line.leave(ticket, left or isinstance(error, Hangup))
            raise
        return ticket

    async def _wait(self, ticket: Ticket) -> None:
        """Tells the page its place in the queue until it is its turn; it has nothing to say."""
        if ticket.admitted:
            return
        spoken = asyncio.create_task(self._receive())
        try:
            while not ticket.admitted:
                ticket.changed.clear()
                await self._socket.send_text(str(encode(self._sessions.place(ticket))))
                moved = asyncio.create_task(ticket.changed.wait())
                await asyncio.wait({spoken, moved}, timeout=REFRESH, return_when=FIRST_COMPLETED)
                moved.cancel()
                if ticket.replaced:
                    raise Hangup(GOING, ELSEWHERE, again=True)
                if ticket.turned_away:
                    raise Hangup(BUSY, ENDING, again=True)
                if spoken.done():
                    spoken.result()
                    raise Hangup(BROKEN, "a page that waits for its turn sends nothing.")
        finally:
            spoken.cancel()

    async def _hello(self) -> Hello:
        try:
            frame = await asyncio.wait_for(self._receive(), HELLO_SECONDS)
            message = decode_client(frame)
        except TimeoutError:
            raise Hangup(BROKEN, "the page did not say hello.") from None
        except ProtocolError as error:
            raise Hangup(TOO_BIG if _is_big(error) else BROKEN, str(error)) from error
        if not isinstance(message, Hello):
            raise Hangup(BROKEN, "the first message must be hello.")
        if message.version != protocol.VERSION:
            versions = {"page": message.version, "server": protocol.VERSION}
            raise Hangup(BROKEN, OUTDATED, **versions)
        return message

    async def _greet(self, session: Session, resumed: bool) -> None:
        assert session.parts is not None
        welcome = Welcome(
            protocol.VERSION,
            session.id,
            resumed,
            session.parts.services,
            self._notices,
            session.parts.dictation,
            self._sessions.offers,
            session.conversation.remembers,
        )
        await self._socket.send_text(str(encode(welcome)))
        if not resumed:
            await session.conversation.greet()

    async def _read(self, session: Session) -> None:
        binary = 0
        while True:
            frame = await self._receive()
            late = session.limits.is_late(frame)
            await asyncio.sleep(self._sessions.backlogs.before_a_look() if late else 0)
            if isinstance(frame, bytes):
                binary += 1
                self._outbox.put(Ack(binary))
            try:
                session.limits.check_frame(frame)
                message = decode_client(frame)
                session.limits.check_message(message)
                await self._handle(session, message)
            except OversizedError as error:
                raise Hangup(TOO_BIG, str(error)) from error
            except ProtocolError as error:
                self._sessions.monitor.failed("protocol")
                if not session.limits.forgive():
                    raise Hangup(BROKEN, str(error), again=True) from error
                self._outbox.put(Error(str(error), fatal=False))

    async def _handle(self, session: Session, message: ClientMessage) -> None:
        """Handles a message and what has waited for it, which takes no more than a fair time."""
        due = session.inlet.admit(message)
        for one, pause in zip(
            due, self._sessions.backlogs.pauses(session.machine, due), strict=True
        ):
            await session.conversation.handle(one)
            if len(due) > 1:
                await asyncio.sleep(pause)

    async def _receive(self) -> str | bytes:
        event = await self._socket.receive()
        if event["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(event.get("code", GOING))
        text = event.get("text")
        return text if text is not None else event.get("bytes") or b""

    async def _write(self) -> None:
        """Sends until the outbox is closed, which ends the connection too."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page is gone
            while (message := await self._next()) is not None:
                try:
                    frame = encode(message)
                except ProtocolError as error:  # one message less, and the conversation goes on
                    self._sessions.monitor.failed("encoding", str(error))
                    continue
                if isinstance(frame, str):
                    await self._socket.send_text(frame)
                else:
                    await self._socket.send_bytes(frame)
            await self._socket.close(GOING)

    async def _next(self) -> ServerMessage | None:
        """What is to be sent next, a beat if there is nothing else; None if nothing more comes."""
        try:
            async with asyncio.timeout(BEAT_SECONDS):
                return await self._outbox.get()
        except TimeoutError:
            return Beat()

    async def _break_off(self, error: Exception) -> None:
        """A fault of ours: the page is told, and does not come back to the same again."""
        self._sessions.monitor.failed("connection", cause(error))
        logger.opt(exception=error).debug("the connection's fault in full")
        await self._hang_up(Hangup(FAILED, FAULT, again=True))

    async def _hang_up(self, hangup: Hangup) -> None:
        logger.debug(f"closing a connection with {hangup.code}: {hangup}")
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.send_text(str(encode(hangup.told)))
        await self._close(hangup.code)

    async def _close(self, code: int) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.close(code)


def _is_big(error: ProtocolError) -> bool:
    return isinstance(error, OversizedError)
