"""One service of the conversation as an HTTP server with the OpenAI-compatible API."""

import time
from collections.abc import Callable

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse
from pipecat.processors.frame_processor import FrameProcessor
from starlette.exceptions import HTTPException

from ico3d.chat.remote import expression, language, recognition, voice
from ico3d.chat.remote.door import Door, error_response
from ico3d.chat.remote.headless import Spares
from ico3d.chat.remote.limits import Limits
from ico3d.chat.serving.guard import Guard
from ico3d.chat.serving.network.reach import own_names
from ico3d.errors import Ico3dError, ServiceError
from ico3d.speech.runtime import SpeechModel

KINDS = {"recognition": recognition, "language": language, "voice": voice}


def make_service_app(
    kind: str,
    name: str,
    make: Callable[[], FrameProcessor],
    host: str,
    limits: Limits,
    key: str = "",
) -> Guard:
    """The application for recognition, language or voice.

    Args:
        kind: `recognition`, `language` or `voice`.
        name: Name of the model, as clients see it.
        make: Creates a processor for one request; runs in a thread.
        host: The address that the server is bound to.
        limits: Limits of requests.
        key: Key that clients must send; empty for none.
    """
    app = _bare_app(kind, name)
    KINDS[kind].add_routes(app, name, Spares(make), limits.seconds)
    return Guard(Door(app, limits, key), host, names=own_names(host))


def make_expression_app(
    model: SpeechModel, sha256: str, host: str, limits: Limits, key: str = ""
) -> Guard:
    """The application for expression: sound in, expression values out.

    Args:
        model: Model from sound to expression values.
        sha256: SHA-256 of the model's file, by which clients check that it is theirs.
        host: The address that the server is bound to.
        limits: Limits of requests.
        key: Key that clients must send; empty for none.
    """
    app = _bare_app("expression", sha256)
    expression.add_routes(app, model, sha256)
    return Guard(Door(app, limits, key), host, names=own_names(host))


def _bare_app(kind: str, name: str) -> FastAPI:
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    started = int(time.time())

    @app.get("/health")
    async def health() -> JSONResponse:
        return JSONResponse({"ok": True, "kind": kind, "model": name})

    @app.get("/v1/models")
    async def models() -> JSONResponse:
        model = {"id": name, "object": "model", "created": started, "owned_by": "ico3d"}
        return JSONResponse({"object": "list", "data": [model]})

    @app.exception_handler(HTTPException)
    async def refused(_: Request, error: HTTPException) -> JSONResponse:
        answer = error_response(error.status_code, f"{error.detail.rstrip('.')}.")
        answer.headers.update(error.headers or {})
        return answer

    @app.exception_handler(Ico3dError)
    async def failed(_: Request, error: Ico3dError) -> JSONResponse:
        return error_response(502 if isinstance(error, ServiceError) else 400, str(error))

    @app.exception_handler(TimeoutError)
    async def late(_: Request, error: TimeoutError) -> JSONResponse:
        return error_response(504, "it took too long.")

    return app
