"""Admission of requests to a module: key, size, and number at a time."""

import asyncio
import hmac

from python_multipart.multipart import parse_options_header
from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ico3d.chat.remote.limits import Limits

OPEN_PATHS = ("/health",)
SILENCE = 10.0
"""Seconds without a byte after which a request that is not whole is given up.

So is an answer of which nothing is read for as long.
"""
PACE = 8_000
"""Bytes per second, beyond the first seconds, at which a request has to come: it holds a place."""
UTF_8 = ("utf-8", "utf8", "utf_8")
"""Spellings of the one coding in which forms are read."""
BROKEN, BUSY = 1008, 1013  # WebSocket close codes


class Door:
    """ASGI middleware that admits requests to a module."""

    def __init__(self, app: ASGIApp, limits: Limits, key: str = ""):
        """Wraps `app`; with an empty key no key is needed."""
        self._app, self._limits, self._key = app, limits, key
        self._inside = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Admits or refuses one request or WebSocket handshake."""
        if scope["type"] not in ("http", "websocket") or scope["path"] in OPEN_PATHS:
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(Headers(scope=scope))
        if refusal is not None:
            await _refuse(*refusal, scope, receive, send)
            return
        self._inside += 1
        try:
            body = Body(self._limits, scope, receive, send)
            await self._app(scope, body.receive, body.send)
        finally:
            self._inside -= 1

    def _refusal(self, headers: Headers) -> tuple[int, str] | None:
        given = headers.get("authorization", "").removeprefix("Bearer ").strip()
        if self._key and not hmac.compare_digest(given.encode(), self._key.encode()):
            return 401, "the key is missing or wrong."
        if self._inside >= self._limits.requests:
            return 429, f"{self._limits.requests} requests are being served: try again soon."
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length) > self._limits.megabytes * 1e6:
            return 413, too_large(self._limits.megabytes)
        if not is_plain_form(headers.get("content-type")):
            return 400, "a form must be in UTF-8."
        return None


class Body:
    """A request that is bounded as it arrives: headers may omit the length, or nothing may come."""

    def __init__(self, limits: Limits, scope: Scope, receive: Receive, send: Send):
        """Bounds what `receive` brings; answers through `send`."""
        self._megabytes, self._scope = limits.megabytes, scope
        self._begun = asyncio.get_running_loop().time()
        self._end = self._begun + limits.seconds
        self._is_whole = scope["type"] != "http"
        self._receive, self._send = receive, send
        self._taken, self._refused = 0, False

    async def receive(self) -> Message:
        """The next message; beyond the limits, a message that the client has disconnected."""
        try:
            message = await asyncio.wait_for(self._receive(), self._patience())
        except TimeoutError:
            return {"type": "http.disconnect"}
        self._is_whole = self._is_whole or not message.get("more_body", False)
        self._taken += len(message.get("body", b""))
        return {"type": "http.disconnect"} if self._is_over else message

    async def send(self, message: Message) -> None:
        """Passes the answer on; after a request beyond the limit, sends a refusal instead.

        Raises:
            OSError: If the client does not read, which counts as gone.
        """
        if not self._is_over or self._scope["type"] != "http":
            await self._delivered(message)
        elif not self._refused and message["type"] == "http.response.start":
            self._refused = True
            refusal = error_response(413, too_large(self._megabytes))
            await refusal(self._scope, self._receive, self._send)

    async def _delivered(self, message: Message) -> None:
        try:
            await asyncio.wait_for(self._send(message), SILENCE)
        except TimeoutError:
            raise ConnectionAbortedError("the client does not read its answer.") from None

    def _patience(self) -> float | None:
        """Seconds in which more has to come; None where all is here."""
        if self._is_whole:
            return None
        now = asyncio.get_running_loop().time()
        due = self._begun + SILENCE + self._taken / PACE
        return min(SILENCE, due - now, self._end - now)

    @property
    def _is_over(self) -> bool:
        return self._taken > self._megabytes * 1e6


def is_plain_form(content_type: str | None) -> bool:
    """Whether a request's form, if it is one, is in UTF-8: others may take quadratic time."""
    kind, options = parse_options_header(content_type)  # as Starlette reads it
    charset = options.get(b"charset", b"utf-8").decode("latin-1")
    # Not by codecs.lookup: Python keeps each name that it did not find for ever.
    return kind != b"multipart/form-data" or charset.lower() in UTF_8


def too_large(megabytes: float) -> str:
    """The sentence that refuses a request beyond the limit."""
    return f"the request is larger than {megabytes:g} MB."


def error_response(status: int, sentence: str) -> JSONResponse:
    """An error in the form of the OpenAI API."""
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
