"""Requests to real servers: the one that visitors meet, and those of services."""

import asyncio
import contextlib
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import uvicorn
from loguru import logger
from pipecat.frames.frames import Frame
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from starlette.types import ASGIApp, Receive, Scope, Send

from ico3d.bundle.format import Bundle
from ico3d.chat.remote.app import make_service_app
from ico3d.chat.remote.limits import Limits
from ico3d.chat.serving import server
from ico3d.chat.serving.sites import Sites
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.settings.embedding import Embedding
from ico3d.errors import ProtocolError
from support.bundles.random_bundle import write_random_bundle
from support.chat.remote import make_language
from support.recordings.films import write_wav

KEY = "a key of thirty-two characters!!"
SETTINGS = ChatSettings(
    recognition=Choice("browser", {"fallback": ""}), language=Choice("persona-notes")
)
PATIENCE = 30.0
"""Seconds for which a visitor waits for an answer."""
IMPATIENCE = 0.1
"""Seconds for which one waits who promised more of a request than came, so that none need come."""
QUIET = 0.02
"""Seconds without a byte after which a server has said what it has to say."""


class Passing(FrameProcessor):
    """A service that has nothing to add."""

    async def process_frame(self, frame: Frame, direction: FrameDirection) -> None:
        """Passes a frame on."""
        await super().process_frame(frame, direction)
        await self.push_frame(frame, direction)


class Watched:
    """An application whose exceptions are kept."""

    def __init__(self, app: ASGIApp):
        """Watches `app`."""
        self._app, self.faults = app, list[Exception]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on."""
        try:
            await self._app(scope, receive, send)
        except Exception as error:
            self.faults.append(error)
            raise


class Visits:
    """Servers in a loop of their own, to which bytes are sent."""

    def __init__(self):
        """Starts them."""
        self._loop, self._tasks = asyncio.new_event_loop(), list[asyncio.Task]()
        self._folder = tempfile.TemporaryDirectory()  # of the bundle that is served
        write_random_bundle(Path(self._folder.name) / "a.ico3d", 20)
        bundle = Bundle.open(Path(self._folder.name) / "a.ico3d")
        avatar = server.open_avatar(bundle, SETTINGS)
        sites = Sites(Embedding(("https://example.org",)), KEY)
        apps = {
            "chat": server.make_app(bundle, avatar, "127.0.0.1", sites=sites),
            "open": server.make_app(bundle, avatar, "127.0.0.1"),
        }
        for kind, make in (("recognition", Passing), ("language", make_language)):
            apps[kind] = make_service_app(kind, kind, make, "127.0.0.1", Limits(), KEY)
        self._servers = {
            name: self._loop.run_until_complete(self._start(a)) for name, a in apps.items()
        }

    async def _start(self, app: ASGIApp) -> tuple[uvicorn.Server, int, Watched]:
        watched = Watched(app)
        listener = server.bind("127.0.0.1", 0)
        running = server.make_server(watched)  # pyrefly: ignore
        self._tasks.append(asyncio.create_task(running.serve(sockets=[listener])))
        while not running.started:
            await asyncio.sleep(0.01)
        return running, listener.getsockname()[1], watched

    def read(self, folder: Path) -> None:
        """Sends a request and waits for what the server says.

        Raises:
            ProtocolError: If it is an error of the client's.
            Exception: What the application raised.
        """
        for file in folder.rglob("*.http"):
            running, port, watched = self._servers[file.stem]
            exchange = self._exchange(running, port, file.read_bytes())
            answer = self._loop.run_until_complete(exchange)
            if watched.faults:
                raise watched.faults.pop()
            if answer[9:10] not in (b"1", b"2", b"3"):  # the first digit of the status
                raise ProtocolError("the request was refused, or nobody answered it.")

    async def _exchange(self, running: uvicorn.Server, port: int, request: bytes) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        answer = b""
        writer.write(request)
        with contextlib.suppress(ConnectionError, TimeoutError):
            async with asyncio.timeout(IMPATIENCE if _promises(request) else PATIENCE):
                answer = await _answer(reader, running)
        writer.close()
        while running.server_state.tasks:  # what goes on when its visitor has gone, hangs
            await asyncio.sleep(0.002)
        return answer


def _promises(request: bytes) -> bool:
    """Whether a request may announce more than it holds."""
    head, _, body = request.lower().partition(b"\r\n\r\n")
    announced = re.findall(rb"content-length:[^0-9]*(\d{1,9})", head)
    return b"transfer-encoding" in head or any(int(length) > len(body) for length in announced)


async def _answer(reader: asyncio.StreamReader, running: uvicorn.Server) -> bytes:
    """Takes an answer until it is whole, or nobody works on more of it."""
    answer, idle = b"", 0
    while not _is_whole(answer):
        try:
            piece = await asyncio.wait_for(reader.read(1 << 16), QUIET)
        except TimeoutError:
            idle = 0 if running.server_state.tasks else idle + 1
            if answer or idle > 1:  # on a busy machine the request may just have come
                break
            continue
        if not piece:
            break
        answer += piece
    return answer


def _is_whole(answer: bytes) -> bool:
    """Whether an answer that tells its length has come."""
    head, _, body = answer.partition(b"\r\n\r\n")
    told = [line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:")]
    return bool(told) and len(body) >= int(told[0].split(b":")[1])


def serving() -> Callable[[Path], None]:
    """Starts the servers; gives what reads a request."""
    logger.remove()
    return Visits().read


def _written(name: str, request: bytes) -> Callable[[Path], object]:
    return lambda folder: (folder / f"{name}.http").write_bytes(request)


def _request(line: str, *headers: str, body: bytes = b"") -> bytes:
    length = (f"Content-Length: {len(body)}",) if body else ()
    lines = [f"{line} HTTP/1.1", "Host: 127.0.0.1", *headers, *length]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


def _upload() -> bytes:
    """A sound as a form."""
    with tempfile.TemporaryDirectory() as folder:
        write_wav(Path(folder) / "a.wav")
        sound = (Path(folder) / "a.wav").read_bytes()
    part = b'--xyz\r\nContent-Disposition: form-data; name="file"; filename="a.wav"\r\n\r\n'
    body = part + sound + b"\r\n--xyz--\r\n"
    form = "Content-Type: multipart/form-data; boundary=xyz"
    return _request("POST /v1/audio/transcriptions", KEYED, form, body=body)


KEYED = f"Authorization: Bearer {KEY}"
JSON = "Content-Type: application/json"
SOCKET = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13")
SOCKET += ("Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",)
CHAT = b'{"messages": [{"role": "user", "content": "Hello"}], "temperature": 0.5, "tools": []}'
REQUESTS = {
    "page": _written("open", _request("GET /", "Accept-Encoding: gzip, br;q=0.5")),
    "bundle": _written(
        "open",
        _request("GET /bundle/manifest.json?sha256=0", "If-None-Match: x", "Range: bytes=0-9"),
    ),
    "health": _written("open", _request("GET /health", "Origin: http://127.0.0.1")),
    "socket": _written("open", _request("GET /echo", *SOCKET) + b"\x81\x82\0\0\0\0hi"),
    "conversation": _written("open", _request("GET /ws", *SOCKET) + b"\x81\x82\0\0\0\0{}"),
    "token": _written("chat", _request("POST /token?origin=https://example.org", KEYED)),
    "embedded": _written("chat", _request("GET /embed.js", "Origin: https://example.org")),
    "recognition": _written("recognition", _upload()),
    "language": _written("language", _request("POST /v1/chat/completions", KEYED, JSON, body=CHAT)),
}
