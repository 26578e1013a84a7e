"""`/v1/expressions`: a WebSocket that takes sound in pieces and returns the matching face.

The protocol is described in `ico3d.chat.wire.remote_expression`; rows are those of
`StreamingExpressions`.
"""

import asyncio
import contextlib
import json
from collections.abc import Callable
from typing import TypeGuard

import numpy as np
from fastapi import FastAPI, WebSocket, WebSocketDisconnect

from ico3d.chat.bucket import Bucket
from ico3d.chat.remote.door import BROKEN
from ico3d.chat.serving.limits import FORGIVEN, FORGOTTEN
from ico3d.chat.wire.protocol import EXPRESSION_FPS, MAX_BINARY_FRAME, SPEECH_RATE
from ico3d.chat.wire.remote_expression import FINISH, PATH, ROW, START
from ico3d.common.expression import SPEECH_SIZE
from ico3d.speech.runtime import SpeechModel, StreamingExpressions

LARGEST = MAX_BINARY_FRAME  # bytes of one piece
RATE, AT_ONCE = 300.0, 1000  # messages per second for long, and at once: voices give 0.1 s or more
NEITHER = "send start, PCM16 of at most 64 KiB, or finish."
SOUNDLESS = "send sound between start and finish."
UNSTARTED = "send start after finish."


def add_routes(app: FastAPI, model: SpeechModel, sha256: str) -> None:
    """Adds the WebSocket to an application.

    Args:
        app: The application.
        model: Model from sound to expression values.
        sha256: SHA-256 of the model's file.
    """
    hello = {"model": sha256, "rate": SPEECH_RATE, "fps": EXPRESSION_FPS, "size": SPEECH_SIZE}

    @app.websocket(PATH)
    async def expressions(socket: WebSocket) -> None:
        await socket.accept()
        with contextlib.suppress(WebSocketDisconnect):
            await socket.send_text(json.dumps(hello))
            await _serve(socket, model)


async def _serve(socket: WebSocket, model: SpeechModel) -> None:
    stream, pace = StreamingExpressions(model, SPEECH_RATE), Pace(asyncio.get_running_loop().time)
    while True:
        event = await socket.receive()
        if event["type"] == "websocket.disconnect":
            return
        piece, text = event.get("bytes"), event.get("text")
        if wrong := pace.fault(text if piece is None else piece):
            await socket.close(BROKEN, wrong)
            return
        if text == START:
            stream = StreamingExpressions(model, SPEECH_RATE)
            continue
        if piece is None:
            rows = await asyncio.to_thread(stream.finish)
        else:
            rows = await asyncio.to_thread(stream.push, samples_of(piece))
        await socket.send_bytes(np.ascontiguousarray(rows, ROW).tobytes())


class Pace:
    """What a client may send: pieces of sound as a voice makes them, and little else.

    A message without sound costs this server as much as the client likes, so a few of them are
    borne and no more.
    """

    def __init__(self, now: Callable[[], float]):
        """Starts a connection; `now` returns the time in seconds."""
        self._messages = Bucket(RATE, AT_ONCE, now)
        self._forgiveness = Bucket(1 / FORGOTTEN, FORGIVEN - 1, now)
        self._has_sound = True  # since the last `start`, if there was one
        self._finished = False

    def fault(self, message: str | bytes | None) -> str:
        """Counts a message; returns why the connection ends, or an empty text."""
        if not self._messages.take(1):
            return f"more than {RATE:g} messages per second."
        if not is_known(message):
            return NEITHER
        if self._finished and message != START:
            return UNSTARTED
        is_plain = len(message) > 0 if isinstance(message, bytes) else self._has_sound
        self._finished = message == FINISH
        self._has_sound = message != START and (self._has_sound or is_plain)
        return "" if is_plain or self._forgiveness.take(1) else SOUNDLESS


def is_known(message: str | bytes | None) -> TypeGuard[str | bytes]:
    """Whether a message is one of the protocol."""
    if isinstance(message, bytes):
        return len(message) % 2 == 0 and len(message) <= LARGEST
    return message in (START, FINISH)


def samples_of(pcm: bytes) -> np.ndarray:
    """PCM16 as samples (S,) float32 in [-1, 1)."""
    return np.frombuffer(pcm, "<i2").astype(np.float32) / 32768
