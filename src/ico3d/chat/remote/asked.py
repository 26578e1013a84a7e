"""What requests ask for, counted before it is parsed: that is done in the loop of everybody."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TypeVar

from pydantic import BaseModel, ValidationError
from python_multipart.exceptions import FormParserError
from starlette.datastructures import FormData
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

from ico3d.chat.remote.door import too_large
from ico3d.common.typed import loose_json
from ico3d.errors import ProtocolError

MOST_VALUES = 100_000
"""Lists, objects and their entries of a request's JSON, commas of prose included: ten thousand
messages of half a million words have fewer. It takes 30 ms to parse as many."""
MOST_MEGABYTES = 8.0
"""Of a request's JSON: a single letter beyond the Basic Multilingual Plane makes four times as much
of it, and eight requests may be answered at once."""
MOST_FIELDS = 12
"""Of a form, beside its file: the head of each may take 2 ms to read."""
BROKEN = "the request did not come as a whole"
T = TypeVar("T", bound=BaseModel)


async def asked(request: Request, kind: type[T]) -> T:
    """What a request's JSON asks for.

    Raises:
        ProtocolError: If it is no JSON, or something else than `kind`.
        HTTPException: If it is too large, or breaks off.
    """
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if not media.endswith("json"):
        raise ProtocolError("the body must be JSON (Content-Type: application/json).")
    try:
        body = await request.body()
    except ClientDisconnect:
        raise HTTPException(400, BROKEN) from None
    await _ensure_waited_for(request)
    if len(body) > MOST_MEGABYTES * 1e6:
        raise HTTPException(413, too_large(MOST_MEGABYTES))
    try:
        return kind.model_validate(loose_json(body, MOST_VALUES))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"])) or "the body"
        raise ProtocolError(f"{where}: {first['msg']}.") from None
    except ValueError as error:
        raise ProtocolError(f"the body is no JSON ({str(error)[:120]}).") from None


@asynccontextmanager
async def form_of(request: Request) -> AsyncIterator[FormData]:
    """The form of a request with one file, which is closed in the end.

    Raises:
        ProtocolError: If it is no form.
        HTTPException: If it has more files or fields than are read, or breaks off.
    """
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media != "multipart/form-data":
        raise ProtocolError("the body must be a form (Content-Type: multipart/form-data).")
    try:
        form = await request.form(max_files=1, max_fields=MOST_FIELDS)
    except (ClientDisconnect, FormParserError):
        raise HTTPException(400, BROKEN) from None
    try:
        await _ensure_waited_for(request)
        yield form
    finally:
        await form.close()


async def _ensure_waited_for(request: Request) -> None:
    """Begins no work for a client that has left: the next would begin more of it at once."""
    if await request.is_disconnected():
        raise HTTPException(400, BROKEN)
