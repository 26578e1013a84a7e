"""The HTTP server: the page, the files of the bundle, and the WebSocket of conversations."""

import asyncio
import contextlib
import gc
import os
import socket
from collections.abc import AsyncIterator, Collection, Sequence
from pathlib import Path

import uvicorn
from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.responses import JSONResponse, PlainTextResponse
from threadpoolctl import threadpool_limits

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.persona import Persona
from ico3d.chat.parts import Avatar
from ico3d.chat.performing.face import open_face
from ico3d.chat.services import choose
from ico3d.chat.services.offers import offers
from ico3d.chat.services.own_voice import own_of
from ico3d.chat.serving.bundle_files import BundleFiles
from ico3d.chat.serving.connection import Connection
from ico3d.chat.serving.echo import echo
from ico3d.chat.serving.guard import LOOPBACK, Guard
from ico3d.chat.serving.missing import tell_missing
from ico3d.chat.serving.network.certificates import Certificate
from ico3d.chat.serving.network.handshakes import behind_tls
from ico3d.chat.serving.network.lookups import new_loop
from ico3d.chat.serving.network.prompt import PromptProtocol, allow_many_connections
from ico3d.chat.serving.network.reach import as_seen
from ico3d.chat.serving.network.websocket import BoundedWebSocket
from ico3d.chat.serving.page_files import PageFiles
from ico3d.chat.serving.refusals import Refusals
from ico3d.chat.serving.running.alive import told_alive
from ico3d.chat.serving.running.ending import PatientServer
from ico3d.chat.serving.sessions import Sessions
from ico3d.chat.serving.sites import Sites, add_tokens
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire import protocol
from ico3d.chat.wire.sentences import STILL_LIPS
from ico3d.errors import SettingsError

STATIC = Path(__file__).parents[1] / "static"


def open_avatar(bundle: Bundle, settings: ChatSettings, persona: Persona | None = None) -> Avatar:
    """What all sessions of a server share.

    Args:
        bundle: The avatar.
        settings: Settings of the conversation.
        persona: Who the avatar is; by default the bundle's persona.

    Raises:
        BundleError: If the bundle has no head.
        SettingsError: If a service is unknown.
        ModelError: If the bundle's speech model cannot be used.
    """
    head, speech = open_face(bundle)
    persona = persona or bundle.manifest.persona
    own = own_of(bundle, persona)
    services = choose(settings, persona.voice, own)
    sha256 = bundle.manifest.files[SPEECH].sha256 if speech else ""
    moves = bundle.animation, sha256, bundle.gestures
    return Avatar(head, speech, persona, services, settings, *moves, own)


def make_app(
    bundle: Bundle,
    avatar: Avatar | None,
    host: str,
    sessions: Sessions | None = None,
    sites: Sites | None = None,
    names: Collection[str] = (),
) -> Guard:
    """The application of the server.

    Args:
        bundle: The bundle that the page loads.
        avatar: What the sessions share; None for a body without a head, which cannot talk.
        host: Address to which the server is bound.
        sessions: Manages the sessions; by default a new object.
        sites: Other sites that may embed the avatar; by default none.
        names: Further host names of the server, under which strangers may come.
    """
    sites = sites or Sites()
    if avatar is not None:
        sessions = Sessions(avatar) if sessions is None else sessions
        # Strangers may not choose services that cost money, nor learn about the machine.
        sessions.at_home = host in LOOPBACK and not names and not sites.any
        if sessions.at_home:
            voices = avatar.persona.voice, avatar.own_voice
            sessions.offers = offers(avatar.settings, *voices)

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        gc.freeze()  # what stays need not be looked at when a session's memory is freed
        if sessions is not None:
            sessions.monitor.watch(asyncio.get_running_loop())
        async with told_alive():
            yield
        if sessions is not None:
            await sessions.close_all()

    app = FastAPI(lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/health")
    async def health() -> JSONResponse:
        return JSONResponse({"ok": True})

    @app.get("/ready")
    async def ready() -> JSONResponse:
        takes = sessions is None or not sessions.line.is_closed
        return JSONResponse({"ready": takes}, 200 if takes else 503)

    files = BundleFiles(bundle, avatar.persona if avatar else None)

    @app.get("/bundle/{name:path}")
    async def bundle_file(name: str, request: Request) -> Response:
        return await files.serve(name, request)

    if avatar is not None and sessions is not None:
        add_conversation(app, avatar, sessions)
    app.add_api_websocket_route("/echo", echo)
    add_tokens(app, sites)
    add_page(app)
    return Guard(app, host, sites, names, refusals=Refusals())


def add_conversation(app: FastAPI, avatar: Avatar, sessions: Sessions) -> None:
    """Adds the WebSocket of conversations."""
    notices = [] if avatar.speech else [STILL_LIPS.notice()]

    @app.websocket("/ws")
    async def conversation(socket: WebSocket) -> None:
        await socket.accept()
        await Connection(socket, sessions, notices).run()


def add_page(app: FastAPI) -> None:
    """Adds the files of the page or, if it was not built, a sentence on how to build it.

    Browsers that come by a wrong address read so in plain words.
    """
    app.add_exception_handler(404, tell_missing)
    if os.path.isfile(STATIC / "index.html"):
        app.mount("/", PageFiles(STATIC))
        return

    @app.get("/")
    async def missing() -> PlainTextResponse:
        return PlainTextResponse("The page is not built: run `make viewer` and reload.\n", 503)


def bind(host: str, port: int) -> socket.socket:
    """Opens the port, before anything else is loaded.

    Raises:
        SettingsError: If the port cannot be opened.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio lets small messages out at once only where it knows the protocol
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise _taken(host, port, error) from error
    return listener


def listen(listener: socket.socket) -> None:
    """Takes connections from now on: whoever reads the address and comes at once is served soon.

    Raises:
        SettingsError: If another server began to listen on the port since it was opened.
    """
    host, port = listener.getsockname()[:2]
    try:
        listener.listen()
    except OSError as error:
        listener.close()
        raise _taken(host, port, error) from error


def _taken(host: str, port: int, error: OSError) -> SettingsError:
    return SettingsError(
        f"port {port} on {host} cannot be used ({error.strerror}): "
        "choose another one with --port (make demo: PORT=...), 0 takes any."
    )


def address(listener: socket.socket, scheme: str = "http") -> str:
    """The URL under which the page can be opened on this machine."""
    host, port = listener.getsockname()[:2]
    shown = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"{scheme}://{shown}:{port}/"


def make_server(
    app: Guard,
    certificate: Certificate | None = None,
    proxies: Sequence[str] = (),
    sessions: Sessions | None = None,
) -> uvicorn.Server:
    """A server for `app`, by HTTPS if there is a certificate.

    Run it with `server.run(sockets=[listener])`. On SIGTERM the answers of `sessions` are finished
    first. `proxies` are the addresses and networks that are believed where a visitor comes from
    (X-Forwarded-For); nobody else is.

    From then on numpy multiplies matrices in one thread. The server's matrices are small, and
    further threads would busily wait on cores that conversations need.
    """
    threadpool_limits(1, user_api="blas")
    allow_many_connections()
    config = uvicorn.Config(
        app,
        loop=f"{new_loop.__module__}:{new_loop.__name__}",
        log_config=None,  # `operator_log` takes what it says
        log_level="warning",
        ws=BoundedWebSocket,
        ws_max_size=protocol.MAX_BINARY_FRAME,
        ws_per_message_deflate=False,  # sound hardly shrinks, and a core has better things to do
        timeout_graceful_shutdown=2,
        server_header=False,
        http=behind_tls(certificate) if certificate else PromptProtocol,
        proxy_headers=bool(proxies),
        forwarded_allow_ips=as_seen(proxies),
    )
    return PatientServer(config, sessions)
