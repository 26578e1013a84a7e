"""`/v1/expressions`: a WebSocket that takes sound in pieces and gives the face that belongs to it.

What is said on it tells `ico3d.chat.wire.remote_expression`; rows are those of
`StreamingExpressions`.
"""

import asyncio
import contextlib
import json

import numpy as np
from fastapi import FastAPI, WebSocket, WebSocketDisconnect

from ico3d.chat.remote.door import BROKEN
from ico3d.chat.wire.protocol import EXPRESSION_FPS, MAX_BINARY_FRAME, SPEECH_RATE
from ico3d.chat.wire.remote_expression import FINISH, PATH, ROW, START
from ico3d.common.expression import SPEECH_SIZE
from ico3d.speech.runtime import SpeechModel, StreamingExpressions

LARGEST = MAX_BINARY_FRAME  # bytes of one piece


def add_routes(app: FastAPI, model: SpeechModel, sha256: str) -> None:
    """Adds the WebSocket.

    Args:
        app: Where to.
        model: What turns sound into expressions.
        sha256: Of its file.
    """
    hello = {"model": sha256, "rate": SPEECH_RATE, "fps": EXPRESSION_FPS, "size": SPEECH_SIZE}

    @app.websocket(PATH)
    async def expressions(socket: WebSocket) -> None:
        await socket.accept()
        with contextlib.suppress(WebSocketDisconnect):
            await socket.send_text(json.dumps(hello))
            await _serve(socket, model)


async def _serve(socket: WebSocket, model: SpeechModel) -> None:
    stream = StreamingExpressions(model, SPEECH_RATE)
    while True:
        event = await socket.receive()
        if event["type"] == "websocket.disconnect":
            return
        piece = event.get("bytes")
        if piece is not None and len(piece) % 2 == 0 and len(piece) <= LARGEST:
            rows = await asyncio.to_thread(stream.push, samples_of(piece))
        elif event.get("text") == START:
            stream = StreamingExpressions(model, SPEECH_RATE)
            continue
        elif event.get("text") == FINISH:
            rows = await asyncio.to_thread(stream.finish)
        else:
            await socket.close(BROKEN, "send start, PCM16 of at most 64 KiB, or finish.")
            return
        await socket.send_bytes(np.ascontiguousarray(rows, ROW).tobytes())


def samples_of(pcm: bytes) -> np.ndarray:
    """PCM16 as (S,) float32 in [-1, 1), as everywhere in the conversation."""
    return np.frombuffer(pcm, "<i2").astype(np.float32) / 32768
