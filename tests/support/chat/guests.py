"""Visitors without a wire, for conversations in virtual time."""

import asyncio
import contextlib
import dataclasses

import numpy as np

from ico3d.chat.page import Outbox
from ico3d.chat.serving import server
from ico3d.chat.serving.sessions import Sessions
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as CHUNK
from ico3d.chat.wire.protocol import MICROPHONE_RATE, VERSION, Audio, Hello, Speech
from ico3d.measure.talking.page import CLOCK_EVERY, Player


class Guest:
    """A page without a wire: speaks into a session and keeps what comes, with its time."""

    def __init__(self, sessions, session, outbox):
        self.session, self.log, self.player = session, [], Player()
        self._sessions, self._outbox = sessions, outbox
        self._tasks = [asyncio.create_task(job) for job in (self._read(), self._play())]

    @classmethod
    async def enter(cls, sessions, hello=None, ticket=None):
        outbox, hello = Outbox(), hello or Hello(VERSION, None, -1)
        session, resumed = await sessions.enter(hello, outbox, ticket or sessions.line_up(hello))
        if not resumed:
            await session.conversation.greet()
        return cls(sessions, session, outbox)

    async def say(self, pcm, silence=2.0):
        """Speaks in real time, then leaves the microphone open; returns when the words ended."""
        now = asyncio.get_running_loop().time
        end = now() + len(pcm) / MICROPHONE_RATE
        sound = np.concatenate([pcm, np.zeros(int(silence * MICROPHONE_RATE), np.int16)])
        for at in range(0, len(sound) - CHUNK, CHUNK):
            await asyncio.sleep(CHUNK / MICROPHONE_RATE)
            await self.session.conversation.handle(Audio(at, sound[at : at + CHUNK]))
        return end

    def speech(self):
        """The speech messages that came."""
        return [message for _, message in self.got(Speech)]

    def got(self, kind, since=0.0):
        return [
            (at, message) for at, message in self.log if isinstance(message, kind) and at > since
        ]

    async def leave(self, for_good=False):
        """The connection drops, or is closed."""
        self._sessions.leave(self.session, self._outbox, for_good)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _read(self):
        while (message := await self._outbox.get()) is not None:
            now = asyncio.get_running_loop().time()
            self.player.take(message, now)
            self.log.append((now, message))

    async def _play(self):
        while True:
            clock = self.player.clock(asyncio.get_running_loop().time())
            if clock is not None:
                await self.session.conversation.handle(clock)
            await asyncio.sleep(CLOCK_EVERY)


@contextlib.asynccontextmanager
async def open_sessions(bundle, services, settings=None, monitor=None):
    avatar = server.open_avatar(bundle, settings or ChatSettings())
    avatar = dataclasses.replace(avatar, services=services)
    sessions = Sessions(avatar, monitor=monitor)
    try:
        yield sessions
    finally:
        await sessions.close_all()
