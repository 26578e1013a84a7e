"""Client of a remote expression module; falls back to the local speech model."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from urllib.parse import urlsplit

import numpy as np
from loguru import logger
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from ico3d.chat.observing.failures import cause
from ico3d.chat.settings.conversation import Expression
from ico3d.chat.settings.keys import key_for
from ico3d.chat.wire.protocol import EXPRESSION_FPS, SPEECH_RATE
from ico3d.chat.wire.remote_expression import FINISH, PATH, ROW, START
from ico3d.common.espeak.speech import Phoneme
from ico3d.common.expression import SPEECH_SIZE
from ico3d.common.typed import loose_json
from ico3d.errors import Ico3dError, ServiceError
from ico3d.speech.runtime import SpeechModel, StreamingExpressions

AVOIDED = 20.0  # s for which a server that failed is not asked again
MOST_BEHIND = 1.0  # s that its answers may take longer than the sound: it is made two seconds ahead
ROW_SAMPLES = SPEECH_RATE // EXPRESSION_FPS
SPARE_ROWS = 8
"""Rows that an answer may have beyond the sound: a very short sound has six."""
FAILURES = (OSError, WebSocketException, Ico3dError, ValueError, RecursionError)
"""TimeoutError is an OSError; JSON may be nested too deep."""


class RemoteMouth:
    """Computes the mouths of one session's sentences over one connection."""

    def __init__(
        self,
        settings: Expression,
        model: SpeechModel,
        sha256: str,
        now: Callable[[], float] = time.monotonic,
    ):
        """Connects later, when it is needed.

        Args:
            settings: Address of the module, key and time limit.
            model: The avatar's own speech model, as fallback.
            sha256: SHA-256 of the model's file; the module must have the same model.
            now: Returns the time in seconds.
        """
        self.model = model
        self._settings, self._sha256, self._now = settings, sha256, now
        self._lock = threading.Lock()  # a sentence that was interrupted may still be under way
        self._socket: ClientConnection | None = None
        self._sentence = 0
        self._behind = 0.0  # s
        self._avoided_until = float("-inf")

    def lips(self) -> "RemoteLips":
        """A new object for the mouth of one sentence; nothing that is under way is waited for."""
        self._sentence += 1
        return RemoteLips(self, self._sentence)

    def ask(
        self, sentence: int, message: bytes | str, is_first: bool, fitting: range
    ) -> np.ndarray:
        """Sends a message of a sentence; returns the rows (n, C) of the answer.

        Args:
            sentence: Number of the sentence.
            message: The message.
            is_first: Whether it is the first one of the sentence.
            fitting: How many rows the answer may have.

        Raises:
            OSError: If the module does not answer, or not in time.
            WebSocketException: If the module closes the connection.
            ServiceError: If the module failed recently, or its answer is invalid.
        """
        with self._lock:
            if sentence != self._sentence:
                return np.zeros((0, SPEECH_SIZE), np.float32)  # nobody waits for it
            if self._now() < self._avoided_until:
                raise ServiceError("it failed a moment ago.")
            try:
                begun = self._now()
                rows = self._exchange(message, is_first, fitting)
                self._keep_up(self._now() - begun, len(rows) / EXPRESSION_FPS)
                return rows
            except FAILURES as error:
                self._avoided_until = self._now() + AVOIDED
                self._hang_up()
                logger.error(f"remote expression failed, the own model goes on: {cause(error)}")
                raise

    def close(self) -> None:
        """Closes the connection."""
        with self._lock:
            self._hang_up()

    def _keep_up(self, took: float, gave: float) -> None:
        """Counts by how many seconds answers fall behind the sound that they are for.

        Raises:
            ServiceError: If it is too many: then speech would stutter, though each came in time.
        """
        self._behind = max(0.0, self._behind + took - gave)
        if self._behind > MOST_BEHIND:
            self._behind = 0.0
            raise ServiceError("its answers take longer than the sound.")

    def _exchange(self, message: bytes | str, is_first: bool, fitting: range) -> np.ndarray:
        line = self._socket or self._connected()
        with _cutting(line, self._settings.timeout):
            if is_first:
                line.send(START)
            line.send(message)
        answer = line.recv(self._settings.timeout)
        if isinstance(answer, str) or len(answer) % (ROW.itemsize * SPEECH_SIZE):
            raise ServiceError("its answer is no rows.")
        rows = np.frombuffer(answer, ROW).reshape(-1, SPEECH_SIZE).astype(np.float32)
        if len(rows) not in fitting:
            raise ServiceError("its answer does not have as many rows as the sound.")
        if not np.isfinite(rows).all():
            raise ServiceError("its rows are not finite.")
        return rows

    def _connected(self) -> ClientConnection:
        settings = self._settings
        key = key_for(settings.url, settings.key_variable, "chat settings: [expression]")
        url = settings.url.replace("http", "ws", 1).rstrip("/") + PATH
        line = self._socket = connect(
            url,
            sock=_opened(url, settings.timeout),
            additional_headers={"Authorization": f"Bearer {key}"} if key else {},
            open_timeout=settings.timeout,
            close_timeout=settings.timeout,
            proxy=None,
        )
        hello = loose_json(line.recv(settings.timeout))
        own = {
            "model": self._sha256,
            "rate": SPEECH_RATE,
            "fps": EXPRESSION_FPS,
            "size": SPEECH_SIZE,
        }
        if hello != own:
            raise ServiceError("it serves another avatar's model: start it with this --bundle.")
        return line

    def _hang_up(self) -> None:
        line, self._socket = self._socket, None
        if line is not None:
            which = line, self._settings.timeout
            threading.Thread(target=_close, args=which, daemon=True).start()  # it may wait


def _opened(url: str, seconds: float) -> socket.socket:
    """A connection to a server, whose name is looked up in no more time than that either.

    Raises:
        OSError: If there is none.
    """
    parts = urlsplit(url)
    port = parts.port or (443 if parts.scheme == "wss" else 80)
    found: Future[socket.socket] = Future()

    def open_it() -> None:
        try:
            found.set_result(socket.create_connection((parts.hostname, port), seconds))
        except OSError as error:
            found.set_exception(error)

    threading.Thread(target=open_it, daemon=True).start()  # a silent name server takes 10 s
    return found.result(seconds)


@contextlib.contextmanager
def _cutting(line: ClientConnection, seconds: float) -> Generator[None, None, None]:
    """Cuts a line whose other end does not take what is sent: that has no time limit of its own."""
    cut = threading.Timer(seconds, _cut, (line,))
    cut.daemon = True
    cut.start()
    try:
        yield
    finally:
        cut.cancel()


def _close(line: ClientConnection, seconds: float) -> None:
    """Closes a line, on which an answer to a ping may be stuck: closing would wait for that."""
    with _cutting(line, seconds):
        line.close()


def _cut(line: ClientConnection) -> None:
    with contextlib.suppress(OSError):  # it was lost just now
        socket.socket.shutdown(line.socket, socket.SHUT_RDWR)  # of TLS, too, without a last word


class RemoteLips:
    """Mouth values of one sentence; continues with the local model if the module fails."""

    def __init__(self, mouth: RemoteMouth, sentence: int):
        """Starts a sentence."""
        self._mouth, self._sentence = mouth, sentence
        self._samples = np.zeros(0, np.float32)  # all that came
        self._given = 0  # rows
        self._own: StreamingExpressions | None = None

    def tell(self, phonemes: Sequence[Phoneme], seconds: float) -> None:
        """The module goes by the sound alone."""

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,) in [-1, 1]; returns the rows (n, C) that are now known."""
        if self._own is not None:
            return self._own.push(samples)
        if len(samples) == 0:  # the module bears few messages without sound
            return np.zeros((0, SPEECH_SIZE), np.float32)
        is_first = len(self._samples) == 0
        self._samples = np.concatenate([self._samples, samples])
        pcm = np.round(samples * 32768).astype("<i2").tobytes()
        return self._asked(pcm, is_first)

    def finish(self) -> np.ndarray:
        """Ends the sentence; returns the remaining rows (n, C)."""
        if self._own is None:
            rows = self._asked(FINISH, len(self._samples) == 0)
            if self._own is None:
                return rows
            return np.concatenate([rows, self._own.finish()])
        return self._own.finish()

    def _asked(self, message: bytes | str, is_first: bool) -> np.ndarray:
        try:
            rows = self._mouth.ask(self._sentence, message, is_first, self._fitting(message))
        except FAILURES:
            # from the sentence's start, for a row depends on what was before it
            self._own = StreamingExpressions(self._mouth.model, SPEECH_RATE)
            rows = self._own.push(self._samples)[self._given :]
        self._given += len(rows)
        return rows

    def _fitting(self, message: bytes | str) -> range:
        """How many rows the answer to a message may have; after the last one, none are missing."""
        missing = len(self._samples) // ROW_SAMPLES - self._given
        return range(missing if message == FINISH else 0, missing + SPARE_ROWS + 1)
