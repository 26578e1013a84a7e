"""A page without a picture: talks with a server like the viewer, and plays in real time."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as CHUNK
from ico3d.chat.wire.protocol import (
    Audio,
    ClientMessage,
    Clock,
    End,
    Hello,
    Pause,
    Resume,
    ServerMessage,
    Speech,
    State,
    Stop,
    Welcome,
)

PATIENCE = 60.0  # s within which anything awaited must come
SCHEDULING = 0.05  # s from the arrival of the first piece to its first sample
CLOCK_EVERY = 0.15  # s

M = TypeVar("M", bound=ServerMessage)


class Player:
    """Computes when each sample of an utterance would be heard."""

    def __init__(self):
        """Starts in silence."""
        self.utterance = -1
        self.started = 0.0  # monotonic s of sample 0
        self.received = 0.0  # s of sound
        self._ended = True
        self._paused: float | None = None  # position at which it waits

    def take(self, message: ServerMessage, now: float) -> None:
        """Updates the state by a message that arrived at time `now` in seconds."""
        if isinstance(message, Speech):
            if message.utterance != self.utterance:
                self.utterance, self.started = message.utterance, now + SCHEDULING
                self._ended, self._paused = False, None
            last = message.first_sample + len(message.pcm)
            self.received = last / protocol.SPEECH_RATE
        elif isinstance(message, Stop | Pause | Resume) and message.utterance == self.utterance:
            if isinstance(message, Stop):
                self._ended = True
            elif isinstance(message, Pause):
                self._paused = self.position(now)
            elif self._paused is not None:
                self.started, self._paused = now - self._paused, None

    def position(self, now: float) -> float:
        """Seconds of the current utterance that have been heard."""
        if self._paused is not None:
            return self._paused
        return float(np.clip(now - self.started, 0, self.received))

    def playing(self, now: float) -> int | None:
        """Number of the utterance that is being heard, or None."""
        sounds = self.started <= now < self.started + self.received
        return self.utterance if sounds and not self._ended and self._paused is None else None

    def clock(self, now: float) -> Clock | None:
        """The report of playback that a page would send now; None after the end was reported."""
        if self._ended:
            return None
        position = self.position(now)
        self._ended = self._paused is None and position >= self.received
        return Clock(self.utterance, position, 0.0)


class SimulatedPage:
    """One connection; everything that arrives is kept in `log` with its time."""

    def __init__(self, socket: ClientConnection, microphone: bool):
        """Takes an open socket; call `open_page` instead."""
        self._socket = socket
        self.log: list[tuple[float, ServerMessage]] = []
        self.player = Player()
        self._arrived = asyncio.Event()
        self._sound = np.zeros(0, np.int16)  # still to be said
        self._sample = 0
        self._opened = time.monotonic()
        self.lag = 0.0
        """Seconds that it takes to read a message."""
        self._microphone = microphone
        self._tasks = self._work()

    async def send(self, message: ClientMessage) -> None:
        """Sends a message."""
        await self._socket.send(encode(message))

    async def send_frame(self, frame: str | bytes) -> None:
        """Sends a raw frame, valid or not."""
        await self._socket.send(frame)

    def say(self, pcm: np.ndarray) -> float:
        """Speaks (S,) int16 at 16 kHz into the microphone in real time.

        Returns:
            Time of the last sample, seconds.
        """
        start = max(self._sample, self._sample + len(self._sound))
        self._sound = np.concatenate([self._sound, pcm])
        return self._opened + (start + len(pcm)) / protocol.MICROPHONE_RATE

    def messages(self, kind: type[M], since: int = 0) -> list[M]:
        """Messages of one kind that have arrived, from log entry `since` on."""
        return [message for _, message in self.log[since:] if isinstance(message, kind)]

    async def wait(
        self,
        kind: type[M],
        since: int = 0,
        timeout: float = PATIENCE,
        where: Callable[[M], bool] = lambda _: True,
    ) -> tuple[float, M]:
        """Waits for the first message of a kind that `where` accepts, from log entry `since` on.

        Returns:
            The time of its arrival in seconds, and the message.

        Raises:
            TimeoutError: If no such message arrives within `timeout` seconds.
        """
        async with asyncio.timeout(timeout):
            seen = since
            while True:
                for at, message in self.log[seen:]:
                    seen += 1
                    if isinstance(message, kind) and where(message):
                        return at, message
                self._arrived.clear()
                await self._arrived.wait()

    async def heard(self, utterance: int) -> None:
        """Waits until an utterance has been played to its end."""
        _, end = await self.wait(End, where=lambda message: message.utterance == utterance)
        while (left := end.samples / protocol.SPEECH_RATE - self._position()) > 0:
            await asyncio.sleep(left)

    def has_heard(self, utterance: int) -> bool:
        """Whether an utterance has been played to its end."""
        ends = [end.samples for end in self.messages(End) if end.utterance == utterance]
        return bool(ends) and self._position() >= ends[0] / protocol.SPEECH_RATE

    def recorded(self, pcm: np.ndarray, end: float) -> Audio:
        """A message of the microphone: (CHUNK,) int16, the last sample recorded at time `end`."""
        playing = self.player.playing(end)
        position = 0.0 if playing is None else self.player.position(end)
        return Audio(self._sample, pcm, playing, position)

    @property
    def state(self) -> str:
        """The avatar's current state, as the server last reported it."""
        states = (m.state for _, m in reversed(self.log) if isinstance(m, State))
        return next(states, "idle")

    def _position(self) -> float:
        return self.player.position(time.monotonic())

    async def close(self) -> tuple[int | None, str]:
        """Ends the connection; returns the close code and reason."""
        await self._rest()
        await self._socket.close()
        return self._socket.close_code, self._socket.close_reason or ""

    async def vanish(self) -> None:
        """Cuts the connection without a farewell, as a broken network does."""
        self._socket.transport.abort()
        await self.close()

    async def stall(self, seconds: float) -> None:
        """Neither reads nor sends for a while, like a suspended machine: not even pings."""
        await self._rest()
        self._socket.transport.pause_reading()
        await asyncio.sleep(seconds)
        self._socket.transport.resume_reading()
        self._tasks = self._work()

    @property
    def is_closed(self) -> bool:
        """Whether the connection has ended."""
        return self._socket.close_code is not None

    async def closed(self) -> int | None:
        """Waits until the server closes the connection; returns the close code."""
        await self._socket.wait_closed()
        return self._socket.close_code

    def _work(self) -> list[asyncio.Task]:
        jobs = [self._read(), self._report(), *([self._record()] if self._microphone else [])]
        return [asyncio.create_task(job) for job in jobs]

    async def _rest(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                message = decode_server(await self._socket.recv())
                now = time.monotonic()
                self.player.take(message, now)
                self.log.append((now, message))
                self._arrived.set()
                if self.lag:
                    await asyncio.sleep(self.lag)

    async def _report(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                clock = self.player.clock(time.monotonic())
                if clock is not None:
                    await self.send(clock)
                await asyncio.sleep(CLOCK_EVERY)

    async def _record(self) -> None:
        """An open microphone: what is to be said, else silence, in real time."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                end = self._opened + (self._sample + CHUNK) / protocol.MICROPHONE_RATE
                await asyncio.sleep(max(0.0, end - time.monotonic()))
                chunk = np.zeros(CHUNK, np.int16)
                said, self._sound = self._sound[:CHUNK], self._sound[CHUNK:]
                chunk[: len(said)] = said
                await self.send(self.recorded(chunk, end))
                self._sample += CHUNK


async def open_page(
    url: str, session: str | None = None, last_index: int = -1, microphone: bool = True
) -> tuple[SimulatedPage, Welcome]:
    """Connects to a server and opens a session.

    Args:
        url: Address of the server, `http://…`.
        session: Id of the session to resume, or None for a new one.
        last_index: Index of the last speech message received in that session.
        microphone: Whether to open the microphone at once.

    Returns:
        The page, and the server's welcome.
    """
    address = url.replace("http", "ws", 1).rstrip("/") + "/ws"
    # browsers send no pings
    socket = await connect(address, max_size=protocol.MAX_BINARY_FRAME, ping_interval=None)
    page = SimulatedPage(socket, microphone)
    await page.send(Hello(protocol.VERSION, session, last_index))
    _, welcome = await page.wait(Welcome)
    return page, welcome
