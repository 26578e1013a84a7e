"""What lets a request into a module: its key, its size, and how many there are."""

import hmac
from collections.abc import Awaitable, Callable

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ico3d.chat.modules.limits import Limits

OPEN_PATHS = ("/health",)
BROKEN, BUSY = 1008, 1013  # WebSocket close codes


class Door:
    """ASGI middleware in front of a module."""

    def __init__(self, app: ASGIApp, limits: Limits, key: str = ""):
        """Guards `app`; an empty key lets everybody in."""
        self._app, self._limits, self._key = app, limits, key
        self._inside = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one request or WebSocket handshake."""
        if scope["type"] not in ("http", "websocket") or scope["path"] in OPEN_PATHS:
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(Headers(scope=scope))
        if refusal is not None:
            await _refuse(*refusal, scope, receive, send)
            return
        self._inside += 1
        try:
            await self._app(scope, self._counted(receive), send)
        finally:
            self._inside -= 1

    def _refusal(self, headers: Headers) -> tuple[int, str] | None:
        given = headers.get("authorization", "").removeprefix("Bearer ").strip()
        if self._key and not hmac.compare_digest(given.encode(), self._key.encode()):
            return 401, "the key is missing or wrong."
        if self._inside >= self._limits.requests:
            return 429, f"{self._limits.requests} requests are being served: try again soon."
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length) > self._most:
            return 413, f"the request is larger than {self._limits.megabytes:g} MB."
        return None

    def _counted(self, receive: Receive) -> Callable[[], Awaitable[Message]]:
        """`receive`, which gives up a body that says nothing of its length and never stops."""
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            return message if taken <= self._most else {"type": "http.disconnect"}

        return counted

    @property
    def _most(self) -> float:
        return self._limits.megabytes * 1e6


def error_response(status: int, sentence: str) -> JSONResponse:
    """An error in the form that clients of the OpenAI API expect."""
    kind = "invalid_request_error" if status < 500 else "server_error"
    error = {"message": sentence, "type": kind, "param": None, "code": None}
    headers = {"Retry-After": "1"} if status in (429, 503) else {}
    return JSONResponse({"error": error}, status, headers)


async def _refuse(status: int, sentence: str, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        code = BUSY if status == 429 else BROKEN
        await send({"type": "websocket.close", "code": code, "reason": sentence})
        return
    await error_response(status, sentence)(scope, receive, send)
