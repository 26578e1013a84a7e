"""`/v1/expressions`: a WebSocket that takes sound in pieces and gives the face that belongs to it.

The server says `{"model": sha256, "rate": 24000, "fps": 25, "size": C}`. The text frame `start`
begins a sound. Every binary frame (PCM16, mono, little-endian, at most 64 KiB) is answered by one
binary frame with the rows known now ((n, C) float32, little-endian, n may be 0), and the text
frame `finish` by the rows that are left. Rows are those of `StreamingExpressions`.
"""

import asyncio
import contextlib
import json

import numpy as np
from fastapi import FastAPI, WebSocket, WebSocketDisconnect

from ico3d.chat.remote.door import BROKEN
from ico3d.chat.wire.protocol import EXPRESSION_FPS, MAX_BINARY_FRAME, SPEECH_RATE
from ico3d.common.expression import SPEECH_SIZE
from ico3d.speech.runtime import SpeechModel, StreamingExpressions

PATH = "/v1/expressions"
START, FINISH = "start", "finish"
LARGEST = MAX_BINARY_FRAME  # bytes of one piece
ROW = np.dtype("<f4")


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
