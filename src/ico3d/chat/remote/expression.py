"""`/v1/expressions`: a WebSocket that takes sound in pieces and returns the matching face.

The protocol is described in `ico3d.chat.wire.remote_expression`; rows are those of
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
    """PCM16 as samples (S,) float32 in [-1, 1)."""
    return np.frombuffer(pcm, "<i2").astype(np.float32) / 32768
